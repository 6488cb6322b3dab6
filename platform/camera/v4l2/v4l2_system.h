// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

namespace viewfix {

// The system calls that a V4L2 camera is driven with, so that tests can put a made-up device in
// their place. Return values and errno as of the calls themselves.
class V4l2System {
 public:
  virtual ~V4l2System() = default;
  virtual int Open(const char* path) = 0;  // read-write, non-blocking, closed on exec
  virtual int Close(int fd) = 0;
  virtual int Ioctl(int fd, unsigned long request, void* argument) = 0;
  // Waits for the device, or for `wake_fd`. Events of poll(2) of the device; 0: time is over, or
  // woken; -1: errno.
  virtual int Poll(int fd, int wake_fd, int timeout_ms) = 0;
  virtual void* Map(int fd, std::size_t length, std::size_t offset) = 0;  // null: errno
  virtual void Unmap(void* memory, std::size_t length) = 0;
  // Paths of the video nodes, in the order of their numbers.
  virtual std::vector<std::string> Nodes() = 0;
  // What a path leads to once links are followed; empty: nothing.
  virtual std::string Resolve(const std::string& path) = 0;
  // Names below /dev/v4l/by-id and by-path that lead to this node: stable from boot to boot.
  virtual std::vector<std::string> StableNames(const std::string& node) = 0;
};

// The machine's own. Stateless.
V4l2System& RealV4l2System();

}  // namespace viewfix
