// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>

#include "platform/camera/frame_source.h"

namespace viewfix {

// One frame's room between the thread that captures and the one that localizes. Frames are
// swapped, not copied: each side gets the other's memory back.
class FrameMailbox {
 public:
  enum class Taken { kFrame, kNothing, kEnded };
  using Milliseconds = std::chrono::milliseconds;

  // `every_frame`: a frame waits until the one before it is taken (a replay); else it takes its
  // place (a camera).
  explicit FrameMailbox(bool every_frame) : every_frame_(every_frame) {}

  // False: there was no room within the time; ask again. Never false for a camera.
  bool Put(Frame& frame, Milliseconds patience);
  Taken Take(Frame& frame, Milliseconds patience);
  // No frame follows; what lies in the box may still be taken.
  void Close();
  // The newest frame made it in before the last one was taken.
  std::uint64_t replaced() const;

 private:
  const bool every_frame_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  Frame slot_;
  bool full_ = false;
  bool closed_ = false;
  std::uint64_t replaced_ = 0;
};

}  // namespace viewfix
