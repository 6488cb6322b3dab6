// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <mutex>

#include "platform/camera/live_camera.h"

namespace viewfix {

// Buffers that libcamera's thread has completed, for ours to wait for and to take, first come
// first. Allocates nothing. Thread-safe.
class CompletedQueue {
 public:
  static constexpr std::size_t kCapacity = 64;

  CompletedQueue() : ready_fd_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}
  ~CompletedQueue() {
    if (ready_fd_ >= 0) ::close(ready_fd_);
  }
  CompletedQueue(const CompletedQueue&) = delete;
  CompletedQueue& operator=(const CompletedQueue&) = delete;

  void Push(std::uint32_t index) {
    const std::lock_guard lock(mutex_);
    // There are fewer buffers: one more is a library gone mad.
    if (count_ == kCapacity) broken_ = true;
    if (!broken_) indices_[(first_ + count_++) % kCapacity] = index;
    (void)::eventfd_write(ready_fd_, 1);
  }

  // The camera is gone.
  void Break() {
    const std::lock_guard lock(mutex_);
    broken_ = true;
    (void)::eventfd_write(ready_fd_, 1);
  }

  // As CameraStream's.
  int Wait(int wake_fd, int timeout_ms) const {
    pollfd waiting[] = {{ready_fd_, POLLIN, 0}, {wake_fd, POLLIN, 0}};
    return ::poll(waiting, 2, timeout_ms) > 0 ? waiting[0].revents : 0;
  }

  CameraStream::Dequeued Pop(std::uint32_t& index) {
    const std::lock_guard lock(mutex_);
    if (broken_) return CameraStream::Dequeued::kBroken;
    if (count_ == 0) {
      eventfd_t seen = 0;
      (void)::eventfd_read(ready_fd_, &seen);
      return CameraStream::Dequeued::kNone;
    }
    index = indices_[first_];
    first_ = (first_ + 1) % kCapacity;
    --count_;
    return CameraStream::Dequeued::kBuffer;
  }

 private:
  const int ready_fd_;
  std::mutex mutex_;
  std::array<std::uint32_t, kCapacity> indices_ = {};
  std::size_t first_ = 0, count_ = 0;
  bool broken_ = false;
};

}  // namespace viewfix
