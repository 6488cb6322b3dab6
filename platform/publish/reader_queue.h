// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

namespace viewfix {

// Whether a reader still gets lines: one that has too much waiting misses them, and one that misses
// too many in a row is to be dropped.
class ReaderQueue {
 public:
  enum class Verdict { kSend, kMiss, kDrop };

  ReaderQueue(std::size_t max_bytes, int max_missed)
      : max_bytes_(max_bytes), max_missed_(max_missed) {}

  Verdict Judge(std::size_t waiting_bytes, std::size_t line_bytes) {
    if (waiting_bytes + line_bytes <= max_bytes_) {
      missed_ = 0;
      return Verdict::kSend;
    }
    return ++missed_ > max_missed_ ? Verdict::kDrop : Verdict::kMiss;
  }

 private:
  std::size_t max_bytes_;
  int max_missed_;
  int missed_ = 0;  // in a row
};

}  // namespace viewfix
