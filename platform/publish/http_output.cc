// SPDX-License-Identifier: BSD-3-Clause
#include "platform/publish/http_output.h"

#include <arpa/inet.h>
#include <event2/bufferevent.h>
#include <event2/http_struct.h>
#include <event2/keyvalq_struct.h>
#include <netinet/in.h>
#include <sodium.h>
#include <sys/queue.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "platform/file.h"
#include "platform/publish/map_json.h"

namespace viewfix {
namespace {

constexpr int kTimeoutS = 10;  // of a request, and of a reader of events that takes nothing
constexpr ev_ssize_t kMaxHeaderBytes = 8192;
constexpr ev_ssize_t kMaxBodyBytes = 1024;
constexpr std::size_t kMinTokenBytes = 16;
constexpr timeval kAcceptAgain = {1, 0};

struct Address {
  sockaddr_storage storage = {};
  int size = 0;  // 0: not a numeric address
};

Address ParseAddress(std::string text, int port) {
  if (text == "localhost") text = "127.0.0.1";
  if (text.size() > 2 && text.front() == '[' && text.back() == ']') {
    text = text.substr(1, text.size() - 2);
  }
  Address address;
  auto* four = reinterpret_cast<sockaddr_in*>(&address.storage);
  auto* six = reinterpret_cast<sockaddr_in6*>(&address.storage);
  if (::inet_pton(AF_INET, text.c_str(), &four->sin_addr) == 1) {
    four->sin_family = AF_INET;
    four->sin_port = htons(static_cast<std::uint16_t>(port));
    address.size = sizeof *four;
  } else if (::inet_pton(AF_INET6, text.c_str(), &six->sin6_addr) == 1) {
    six->sin6_family = AF_INET6;
    six->sin6_port = htons(static_cast<std::uint16_t>(port));
    address.size = sizeof *six;
  }
  return address;
}

bool SameToken(std::string_view given, std::string_view token) {
  return given.size() == token.size() &&
         sodium_memcmp(given.data(), token.data(), token.size()) == 0;
}

// Of "?token=..." : EventSource cannot send headers.
std::string QueryToken(evhttp_request* request) {
  const char* query = evhttp_uri_get_query(evhttp_request_get_evhttp_uri(request));
  evkeyvalq values = {};
  std::string token;
  if (query == nullptr || evhttp_parse_query_str(query, &values) != 0) return token;
  if (const char* value = evhttp_find_header(&values, "token"); value != nullptr) token = value;
  evhttp_clear_headers(&values);
  return token;
}

std::string HeaderToken(evhttp_request* request) {
  constexpr std::string_view kBearer = "Bearer ";
  const char* header =
      evhttp_find_header(evhttp_request_get_input_headers(request), "Authorization");
  const std::string_view text = header == nullptr ? "" : header;
  return text.rfind(kBearer, 0) == 0 ? std::string(text.substr(kBearer.size())) : std::string();
}

// A page of another site whose name was made to lead here asks under that name.
bool IsLocalName(evhttp_request* request) {
  const char* host = evhttp_request_get_host(request);
  const std::string_view name = host == nullptr ? "" : host;
  return name.empty() || name == "localhost" || name == "[::1]" || name == "::1" ||
         name.rfind("127.", 0) == 0;
}

}  // namespace

Result<std::string> ReadToken(const std::string& path) {
  const Result<std::vector<std::uint8_t>> bytes = ReadFile(path);
  if (!bytes.ok()) return bytes.status();
  std::string token;
  for (const std::uint8_t byte : *bytes) {
    if (byte <= ' ' || byte > '~') break;
    token.push_back(static_cast<char>(byte));
  }
  if (token.size() >= kMinTokenBytes) return token;
  return Status(StatusCode::kInvalidArgument, "a token has at least 16 characters", path);
}

const HttpOutput::Page HttpOutput::kPages[] = {
    {"/", &HttpOutput::LivePage},           {"/fix", &HttpOutput::LastFix},
    {"/events", &HttpOutput::Events},       {"/health", &HttpOutput::HealthPage},
    {"/metrics", &HttpOutput::MetricsPage}, {"/map.json", &HttpOutput::Map},
    {"/floorplan", &HttpOutput::FloorPlan}, {"/frame.jpg", &HttpOutput::FramePicture},
};

HttpOutput::~HttpOutput() {
  // Closing a connection takes its stream from the list.
  while (!streams_.empty()) {
    evhttp_connection_free(evhttp_request_get_connection(streams_.front().request));
  }
}

Status HttpOutput::Listen(const std::string& address, int port, const std::string& token) {
  token_ = token;
  const std::string where = address + ":" + std::to_string(port);
  const Address numeric = ParseAddress(address, port);
  if (numeric.size == 0) {
    return {StatusCode::kInvalidArgument, "http takes numeric addresses only", where};
  }
  http_.reset(evhttp_new(base_));
  evhttp_set_allowed_methods(http_.get(), EVHTTP_REQ_GET | EVHTTP_REQ_HEAD);
  evhttp_set_max_headers_size(http_.get(), kMaxHeaderBytes);
  evhttp_set_max_body_size(http_.get(), kMaxBodyBytes);
  evhttp_set_timeout(http_.get(), kTimeoutS);
  evhttp_set_gencb(http_.get(), OnRequest, this);
  listener_ = evconnlistener_new_bind(
      base_, nullptr, nullptr, LEV_OPT_CLOSE_ON_FREE | LEV_OPT_CLOSE_ON_EXEC | LEV_OPT_REUSEABLE,
      -1, reinterpret_cast<const sockaddr*>(&numeric.storage), numeric.size);
  if (listener_ == nullptr) {
    return {StatusCode::kIo, "cannot listen", where + ": " + std::strerror(errno)};
  }
  evhttp_bind_listener(http_.get(), listener_);
  evconnlistener_set_error_cb(listener_, OnAcceptError);
  return {};
}

// Without descriptors, accept() fails at once, again and again.
void HttpOutput::OnAcceptError(evconnlistener* listener, void*) {
  evconnlistener_disable(listener);
  event_base_once(
      evconnlistener_get_base(listener), -1, EV_TIMEOUT,
      [](evutil_socket_t, short, void* same) {
        evconnlistener_enable(static_cast<evconnlistener*>(same));
      },
      listener, &kAcceptAgain);
}

void HttpOutput::OnRequest(evhttp_request* request, void* self) {
  auto* output = static_cast<HttpOutput*>(self);
  ++output->counts_.requests;
  output->Route(request);
}

void HttpOutput::Route(evhttp_request* request) {
  if (!MayAsk(request)) {
    return Reply(
        request, 403, "text/plain",
        token_.empty() ? "Only under a name of this machine.\n" : "This needs the token.\n");
  }
  const char* path = evhttp_uri_get_path(evhttp_request_get_evhttp_uri(request));
  const std::string_view asked = path == nullptr || *path == '\0' ? "/" : path;
  for (const Page& page : kPages) {
    if (asked == page.path) return (this->*page.answer)(request);
  }
  Reply(request, 404, "text/plain", "There is no such page.\n");
}

bool HttpOutput::MayAsk(evhttp_request* request) {
  if (token_.empty()) return IsLocalName(request);
  return SameToken(HeaderToken(request), token_) || SameToken(QueryToken(request), token_);
}

void HttpOutput::Reply(evhttp_request* request, int code, const char* type, std::string_view body) {
  evkeyvalq* headers = evhttp_request_get_output_headers(request);
  evhttp_add_header(headers, "Content-Type", type);
  evhttp_add_header(headers, "Cache-Control", "no-store");
  evhttp_add_header(headers, "X-Content-Type-Options", "nosniff");
  evhttp_add_header(headers, "Referrer-Policy", "no-referrer");
  const EventHandle<evbuffer> buffer(evbuffer_new());
  evbuffer_add(buffer.get(), body.data(), body.size());
  evhttp_send_reply(request, code, nullptr, buffer.get());
}

void HttpOutput::LivePage(evhttp_request* request) {
  // Nothing from elsewhere, nothing to elsewhere.
  evhttp_add_header(
      evhttp_request_get_output_headers(request), "Content-Security-Policy",
      "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; "
      "img-src 'self' data:; connect-src 'self'; base-uri 'none'; form-action 'none'");
  Reply(request, 200, "text/html; charset=utf-8", LivePageHtml());
}

void HttpOutput::LastFix(evhttp_request* request) {
  if (last_line_.empty()) return Reply(request, 503, "text/plain", "No frame yet.\n");
  Reply(request, 200, "application/json", last_line_);
}

void HttpOutput::HealthPage(evhttp_request* request) {
  Reply(request, content_.well() ? 200 : 503, "application/json", content_.health(counts_));
}

void HttpOutput::MetricsPage(evhttp_request* request) {
  Reply(request, 200, "text/plain; version=0.0.4", content_.metrics(counts_));
}

void HttpOutput::Map(evhttp_request* request) {
  const std::shared_ptr<const ModelView> model = content_.model();
  if (model == nullptr) return Reply(request, 503, "text/plain", "No model.\n");
  Reply(request, 200, "application/json", MapJson(*model));
}

void HttpOutput::FloorPlan(evhttp_request* request) {
  const std::shared_ptr<const ModelView> model = content_.model();
  if (model == nullptr || !model->has_floor_plan()) {
    return Reply(request, 404, "text/plain", "The model has no floor plan.\n");
  }
  const std::span<const std::uint8_t> picture = model->floor_plan().picture;
  Reply(request, 200, picture[0] == 0x89 ? "image/png" : "image/jpeg",
        {reinterpret_cast<const char*>(picture.data()), picture.size()});
}

void HttpOutput::FramePicture(evhttp_request* request) {
  if (!frame_jpeg_) {
    return Reply(request, 404, "text/plain", "Pictures are off (--frame-picture on).\n");
  }
  const std::vector<std::uint8_t> jpeg = frame_jpeg_();
  if (jpeg.empty()) return Reply(request, 503, "text/plain", "No frame yet.\n");
  Reply(request, 200, "image/jpeg", {reinterpret_cast<const char*>(jpeg.data()), jpeg.size()});
}

// Served by this one thread from the line's arrival on; between lines a stream costs nothing.
void HttpOutput::Events(evhttp_request* request) {
  if (evhttp_request_get_command(request) != EVHTTP_REQ_GET) {
    return Reply(request, 200, "text/event-stream", "");
  }
  if (streams_.size() >= Server::kMaxReaders) {
    ++counts_.dropped_clients;
    return Reply(request, 503, "text/plain", "Too many readers.\n");
  }
  evkeyvalq* headers = evhttp_request_get_output_headers(request);
  evhttp_add_header(headers, "Content-Type", "text/event-stream");
  evhttp_add_header(headers, "Cache-Control", "no-store");
  evhttp_add_header(headers, "X-Content-Type-Options", "nosniff");
  Stream& stream = streams_.emplace_back(
      Stream{this, request, {Server::kMaxQueueBytes, Server::kMaxMissedLines}});
  ++counts_.clients;
  evhttp_connection* connection = evhttp_request_get_connection(request);
  evhttp_connection_set_closecb(connection, OnStreamClosed, &stream);
  evhttp_send_reply_start(request, 200, "OK");
  // A reader says nothing more, so that reading has no time limit; writing has.
  const timeval limit = {kTimeoutS, 0};
  bufferevent_set_timeouts(evhttp_connection_get_bufferevent(connection), nullptr, &limit);
  SendEvent(stream, last_line_);
}

void HttpOutput::OnStreamClosed(evhttp_connection*, void* stream) {
  auto* closed = static_cast<Stream*>(stream);
  HttpOutput* output = closed->output;
  --output->counts_.clients;
  // Where the reader hung up, libevent has taken the request from its connection and leaves it to
  // us: it is still being answered.
  if (evhttp_request_get_connection(closed->request) == nullptr) {
    evhttp_request_free(closed->request);
  }
  output->streams_.remove_if([&](const Stream& s) { return &s == closed; });
}

// The line's '\n' and another end the event.
void HttpOutput::SendEvent(Stream& stream, std::string_view line) {
  if (line.empty()) return;
  const EventHandle<evbuffer> buffer(evbuffer_new());
  evbuffer_add(buffer.get(), "data: ", 6);
  evbuffer_add(buffer.get(), line.data(), line.size());
  evbuffer_add(buffer.get(), "\n", 1);
  evhttp_send_reply_chunk(stream.request, buffer.get());
}

void HttpOutput::Send(std::string_view line) {
  last_line_ = line;
  for (auto next = streams_.begin(); next != streams_.end();) {
    Stream& stream = *next++;
    evhttp_connection* connection = evhttp_request_get_connection(stream.request);
    bufferevent* output = evhttp_connection_get_bufferevent(connection);
    const std::size_t waiting = evbuffer_get_length(bufferevent_get_output(output));
    switch (stream.queue.Judge(waiting, line.size())) {
      case ReaderQueue::Verdict::kSend:
        SendEvent(stream, line);
        break;
      case ReaderQueue::Verdict::kMiss:
        ++counts_.dropped_lines;
        break;
      case ReaderQueue::Verdict::kDrop:
        ++counts_.dropped_clients;
        evhttp_connection_free(connection);  // takes the stream from the list
        break;
    }
  }
}

}  // namespace viewfix
