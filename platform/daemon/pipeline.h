// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <thread>

#include "platform/camera/frame_source.h"
#include "platform/daemon/frame_answerer.h"
#include "platform/daemon/frame_mailbox.h"
#include "platform/daemon/health.h"
#include "platform/daemon/model_holder.h"
#include "platform/daemon/scene_change.h"
#include "platform/log.h"
#include "platform/publish/json_line.h"
#include "platform/publish/publisher.h"

namespace viewfix {

struct PipelineRates {
  double max_fps = 0;   // 0: no limit
  double idle_fps = 0;  // 0: as max_fps
};

// Two threads: one captures, one localizes and publishes; between them a mailbox of one frame.
// Frames that cannot be used are told on stderr, counted and passed over.
class Pipeline {
 public:
  struct Parts {
    ModelHolder* models;
    Health* health;
    Publisher* publisher;
    // Each frame answered, and its key points; null: nobody looks.
    std::function<void(const YuvImage&, std::span<const SeenPoint>)> show;
  };

  Pipeline(std::unique_ptr<FrameSource> source, const PipelineRates& rates, Parts parts);
  ~Pipeline();

  // `on_end` is called once, by one of the threads, when all frames are answered, or publishing
  // is impossible, or Stop() was called.
  void Start(std::function<void()> on_end);
  // Ends both threads; returns when they have ended.
  void Stop();
  // Ends them too, but a frame may still be in the localizer when this returns. Nothing is
  // published from then on.
  void BeginStop();
  // Why publishing became impossible (kCancelled: nobody reads any more), else ok. After on_end.
  Status fault() const { return fault_; }

  void SetRates(const PipelineRates& rates);
  // Goes on with another camera, numbering its frames onward. It must be live if the first was.
  void ReplaceSource(std::unique_ptr<FrameSource> source);
  const std::atomic<bool>& stopping() const { return stop_; }

 private:
  void Capture();
  void AdoptSource();
  void CaptureOne(Frame& frame);
  bool LumaIsEnough() const;
  void Hand(Frame& frame);
  void LocalizeFrames();
  bool Turn(Frame& frame);
  void LookForColours(const Frame& frame);
  bool WaitUntilDue();
  bool Still(const Frame& frame);
  bool Answer(Frame& frame);
  std::uint64_t NumberOf(const Frame& frame);
  bool SayWhyNothing();
  bool Publish(std::string_view line);
  std::int64_t IntervalNs(double fps) const;

  Parts parts_;
  const bool live_;
  LimitedLog log_;
  FrameMailbox mailbox_;
  std::function<void()> on_end_;
  std::atomic<bool> stop_ = false;
  std::atomic<bool> localizing_ = true;
  std::atomic<std::int64_t> wanted_interval_ns_ = 0;
  std::thread capture_thread_, localize_thread_;
  std::mutex publish_mutex_;  // held while a line is published; none is once stop_ is seen under it

  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::unique_ptr<FrameSource> source_;       // Wake() under mutex_, the rest by capture_thread_
  std::unique_ptr<FrameSource> next_source_;  // under mutex_
  PipelineRates rates_;                       // under mutex_

  // Of capture_thread_.
  std::uint64_t sequence_base_ = 0, next_sequence_ = 0;
  bool ended_ = false;
  std::string last_condition_;

  // Of localize_thread_.
  std::shared_ptr<LoadedModel> model_;
  std::optional<FrameAnswerer> answerer_;
  SceneChange scene_;
  bool colours_looked_for_ = false;  // since model_ came
  JsonLine state_line_;
  std::int64_t began_ns_ = 0;  // of the last frame answered
  std::int64_t moved_ns_ = 0;  // when something last moved
  std::int64_t said_ns_ = 0;   // of the last state line
  std::string said_state_;
  std::uint64_t last_sequence_ = 0;
  std::uint64_t number_ = 0;      // of the last frame answered, as the motion counts
  std::int64_t captured_ns_ = 0;  // and when it was captured, by CLOCK_BOOTTIME
  Status fault_;
};

}  // namespace viewfix
