// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace viewfix {

// What became of the lines that went out.
struct PublishCounts {
  std::uint64_t lines = 0;            // published
  std::uint64_t clients = 0;          // reading now, sockets and event streams together
  std::uint64_t dropped_lines = 0;    // that a slow reader did not get
  std::uint64_t dropped_clients = 0;  // closed because they did not read, or were too many
  std::uint64_t requests = 0;         // HTTP
};

}  // namespace viewfix
