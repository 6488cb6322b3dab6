// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <event2/bufferevent.h>

#include <list>
#include <string>
#include <string_view>

#include "engine/base/status.h"
#include "platform/publish/event_handles.h"
#include "platform/publish/publish_counts.h"
#include "platform/publish/reader_queue.h"

namespace viewfix {

// JSON lines to any number of readers of a Unix socket. Of the server's thread.
class UnixOutput {
 public:
  UnixOutput(event_base* base, PublishCounts& counts) : base_(base), counts_(counts) {}
  ~UnixOutput();
  UnixOutput(const UnixOutput&) = delete;
  UnixOutput& operator=(const UnixOutput&) = delete;

  // A socket that nobody serves any more is replaced. kIo: the path is taken, or cannot be made.
  Status Listen(const std::string& path);
  void Send(std::string_view line);

 private:
  struct Reader {
    UnixOutput* output;
    bufferevent* stream;
    ReaderQueue queue;
  };

  static void OnReader(evconnlistener*, int fd, sockaddr*, int, void* self);
  static void OnAcceptError(evconnlistener* listener, void* self);
  static void OnRead(bufferevent* stream, void* reader);
  static void OnEvent(bufferevent* stream, short events, void* reader);
  void Remove(Reader* reader);

  event_base* base_;
  PublishCounts& counts_;
  std::string path_;
  EventHandle<evconnlistener> listener_;
  std::list<Reader> readers_;
};

}  // namespace viewfix
