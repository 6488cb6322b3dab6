// SPDX-License-Identifier: BSD-3-Clause
#include "platform/daemon/frame_mailbox.h"

#include <utility>

namespace viewfix {

bool FrameMailbox::Put(Frame& frame, Milliseconds patience) {
  std::unique_lock lock(mutex_);
  const auto room = [&] { return !full_ || closed_; };
  if (every_frame_ && !changed_.wait_for(lock, patience, room)) return false;
  if (full_) ++replaced_;
  std::swap(slot_, frame);
  full_ = true;
  changed_.notify_all();
  return true;
}

FrameMailbox::Taken FrameMailbox::Take(Frame& frame, Milliseconds patience) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, patience, [&] { return full_ || closed_; });
  if (!full_) return closed_ ? Taken::kEnded : Taken::kNothing;
  std::swap(slot_, frame);
  full_ = false;
  changed_.notify_all();
  return Taken::kFrame;
}

void FrameMailbox::Close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
  changed_.notify_all();
}

std::uint64_t FrameMailbox::replaced() const {
  const std::lock_guard lock(mutex_);
  return replaced_;
}

}  // namespace viewfix
