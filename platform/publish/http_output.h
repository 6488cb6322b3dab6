// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <list>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/status.h"
#include "platform/publish/event_handles.h"
#include "platform/publish/publish_counts.h"
#include "platform/publish/reader_queue.h"
#include "platform/publish/server.h"

namespace viewfix {

// HTTP: /, /fix, /events, /health, /metrics, /map.json, /floorplan, /frame.jpg. Of the server's
// thread.
class HttpOutput {
 public:
  // `frame_jpeg`: the last frame, empty if there is none; null: not served.
  HttpOutput(event_base* base, PublishCounts& counts, const ServerContent& content,
             std::function<std::vector<std::uint8_t>()> frame_jpeg)
      : base_(base), counts_(counts), content_(content), frame_jpeg_(std::move(frame_jpeg)) {}
  ~HttpOutput();
  HttpOutput(const HttpOutput&) = delete;
  HttpOutput& operator=(const HttpOutput&) = delete;

  // Numeric addresses only: a static program has no name service.
  Status Listen(const std::string& address, int port, const std::string& token);
  void Send(std::string_view line);

 private:
  struct Stream {
    HttpOutput* output;
    evhttp_request* request;
    ReaderQueue queue;
  };
  struct Page {
    const char* path;
    void (HttpOutput::*answer)(evhttp_request* request);
  };
  static const Page kPages[];

  static void OnRequest(evhttp_request* request, void* self);
  static void OnAcceptError(evconnlistener* listener, void* self);
  static void OnStreamClosed(evhttp_connection* connection, void* stream);
  void Route(evhttp_request* request);
  bool MayAsk(evhttp_request* request);
  void Reply(evhttp_request* request, int code, const char* type, std::string_view body);

  void LivePage(evhttp_request* request);
  void LastFix(evhttp_request* request);
  void Events(evhttp_request* request);
  void HealthPage(evhttp_request* request);
  void MetricsPage(evhttp_request* request);
  void Map(evhttp_request* request);
  void FloorPlan(evhttp_request* request);
  void FramePicture(evhttp_request* request);
  void SendEvent(Stream& stream, std::string_view line);

  event_base* base_;
  PublishCounts& counts_;
  const ServerContent& content_;
  std::function<std::vector<std::uint8_t>()> frame_jpeg_;
  std::string token_;  // empty: not asked for
  EventHandle<evhttp> http_;
  evconnlistener* listener_ = nullptr;  // http_'s
  std::list<Stream> streams_;
  std::string last_line_;
};

// What a token file holds: its first line. kInvalidArgument: shorter than 16 characters.
Result<std::string> ReadToken(const std::string& path);

// The live page, embedded at build time.
std::string_view LivePageHtml();

}  // namespace viewfix
