// SPDX-License-Identifier: BSD-3-Clause
#include "platform/publish/unix_output.h"

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "platform/publish/server.h"

namespace viewfix {
namespace {

Status Refused(const std::string& path, const char* why) {
  return {StatusCode::kIo, "cannot make socket", path + ": " + why};
}

sockaddr_un AddressOf(const std::string& path) {
  sockaddr_un address = {};
  address.sun_family = AF_UNIX;
  std::copy(path.begin(), path.end(), address.sun_path);
  return address;
}

// Whether somebody serves the socket at this path.
bool IsServed(const sockaddr_un& address) {
  const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) return true;
  const int result = ::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address);
  const bool refused = result != 0 && errno == ECONNREFUSED;
  ::close(fd);
  return !refused;
}

}  // namespace

UnixOutput::~UnixOutput() {
  for (Reader& reader : readers_) bufferevent_free(reader.stream);
  if (listener_ != nullptr) ::unlink(path_.c_str());
}

Status UnixOutput::Listen(const std::string& path) {
  const sockaddr_un address = AddressOf(path);
  struct stat info = {};
  if (::lstat(path.c_str(), &info) == 0) {
    if (!S_ISSOCK(info.st_mode)) return Refused(path, "there is something else");
    if (IsServed(address)) return Refused(path, "another program serves it");
    ::unlink(path.c_str());  // left behind by a power cut
  }
  listener_.reset(
      evconnlistener_new_bind(base_, OnReader, this, LEV_OPT_CLOSE_ON_FREE | LEV_OPT_CLOSE_ON_EXEC,
                              -1, reinterpret_cast<const sockaddr*>(&address), sizeof address));
  if (listener_ == nullptr) return Refused(path, std::strerror(errno));
  path_ = path;
  evconnlistener_set_error_cb(listener_.get(), OnAcceptError);
  (void)::chmod(path.c_str(), 0660);
  return {};
}

// Without descriptors, accept() fails at once, again and again: the waiting reader stays in the
// kernel's queue until one of ours leaves.
void UnixOutput::OnAcceptError(evconnlistener* listener, void*) {
  evconnlistener_disable(listener);
}

void UnixOutput::OnReader(evconnlistener*, int fd, sockaddr*, int, void* self) {
  auto* output = static_cast<UnixOutput*>(self);
  bufferevent* stream = output->readers_.size() < Server::kMaxReaders
                            ? bufferevent_socket_new(output->base_, fd, BEV_OPT_CLOSE_ON_FREE)
                            : nullptr;
  if (stream == nullptr) {
    ++output->counts_.dropped_clients;
    ::close(fd);
    return;
  }
  Reader& reader = output->readers_.emplace_back(
      Reader{output, stream, {Server::kMaxQueueBytes, Server::kMaxMissedLines}});
  ++output->counts_.clients;
  bufferevent_setcb(stream, OnRead, nullptr, OnEvent, &reader);
  bufferevent_enable(stream, EV_READ | EV_WRITE);
}

// Readers have nothing to say; what they say is thrown away.
void UnixOutput::OnRead(bufferevent* stream, void*) {
  evbuffer* input = bufferevent_get_input(stream);
  evbuffer_drain(input, evbuffer_get_length(input));
}

void UnixOutput::OnEvent(bufferevent*, short, void* reader) {
  auto* gone = static_cast<Reader*>(reader);
  gone->output->Remove(gone);
}

void UnixOutput::Remove(Reader* reader) {
  bufferevent_free(reader->stream);
  --counts_.clients;
  readers_.remove_if([&](const Reader& r) { return &r == reader; });
  if (listener_ != nullptr) evconnlistener_enable(listener_.get());
}

void UnixOutput::Send(std::string_view line) {
  for (auto next = readers_.begin(); next != readers_.end();) {
    Reader& reader = *next++;
    const std::size_t waiting = evbuffer_get_length(bufferevent_get_output(reader.stream));
    switch (reader.queue.Judge(waiting, line.size())) {
      case ReaderQueue::Verdict::kSend:
        bufferevent_write(reader.stream, line.data(), line.size());
        break;
      case ReaderQueue::Verdict::kMiss:
        ++counts_.dropped_lines;
        break;
      case ReaderQueue::Verdict::kDrop:
        ++counts_.dropped_clients;
        Remove(&reader);
        break;
    }
  }
}

}  // namespace viewfix
