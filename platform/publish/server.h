// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "models/model_view.h"
#include "platform/camera/jpeg_decoder.h"
#include "platform/publish/publish_counts.h"
#include "platform/publish/publish_settings.h"
#include "platform/publish/publisher.h"

namespace viewfix {

struct SeenPoint;  // engine/localizer.h

// What the server tells besides the lines themselves. All of it is asked for by the server's
// thread.
struct ServerContent {
  std::function<std::string(const PublishCounts&)> health;   // a JSON object
  std::function<std::string(const PublishCounts&)> metrics;  // Prometheus' text
  std::function<bool()> well;                                // /health says 200, else 503
  std::function<std::shared_ptr<const ModelView>()> model;   // null: none
  std::function<void()> beat;                                // a few times a second
};

// The Unix socket and HTTP, in a thread of their own. Publish() and Show() never wait: readers that
// do not keep up miss lines, and are dropped in the end.
class Server : public Publisher {
 public:
  // Of one reader: lines beyond this many waiting bytes are dropped, and after kMaxMissedLines in a
  // row so is the reader.
  static constexpr std::size_t kMaxQueueBytes = std::size_t{1} << 16;
  static constexpr int kMaxMissedLines = 200;
  // Readers of the socket, and of /events; more are turned away.
  static constexpr std::size_t kMaxReaders = 64;

  // The sockets are open when this returns.
  static Result<std::unique_ptr<Server>> Start(const PublishSettings& settings,
                                               ServerContent content);
  ~Server() override;

  Status Publish(std::string_view line) override;
  // The last frame and its key points, for /frame.jpg; not asked for unless the settings say so.
  void Show(const YuvImage& frame, std::span<const SeenPoint> points);
  PublishCounts counts() const;

 private:
  class Impl;
  explicit Server(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace viewfix
