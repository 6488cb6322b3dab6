// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <string_view>
#include <vector>

#include "engine/base/status.h"

namespace viewfix {

// Where fixes go.
class Publisher {
 public:
  virtual ~Publisher() = default;
  // Hands on one JSON line, its '\n' included, whole and at once. kCancelled: nobody reads
  // any more, or a signal came while waiting: time to end, no fault. kIo: it cannot be written.
  virtual Status Publish(std::string_view line) = 0;
};

// Writes to an open file descriptor (stdout: 1), unbuffered, waiting for a slow reader. The
// descriptor is borrowed. SIGPIPE must be ignored by the program. `go_on`, if given, is asked a few
// times a second while the reader does not read; false ends the wait (kCancelled).
std::unique_ptr<Publisher> MakeStreamPublisher(int fd, std::function<bool()> go_on = nullptr);

// The same for frames that do not wait: lines that find more than kMaxWaitingBytes waiting for a
// slow reader are dropped whole.
inline constexpr std::size_t kMaxWaitingBytes = std::size_t{1} << 18;
std::unique_ptr<Publisher> MakeDroppingPublisher(int fd);

// To all of them, in this order; the first that fails ends it.
std::unique_ptr<Publisher> MakeFan(std::vector<std::unique_ptr<Publisher>> outputs);

}  // namespace viewfix
