// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string_view>

#include "platform/publish/json_line.h"

namespace viewfix {

// What is said while there is no frame to answer: a line with the keys of a fix, all that a
// frame would tell null, zero or empty, and `detail` in words for people.
struct StateLine {
  std::string_view state;      // "no_camera", "no_model"
  std::uint64_t sequence = 0;  // of the last frame
  std::string_view model;      // its hash; empty: null
  std::string_view detail;
  std::int64_t now_ns = 0;  // CLOCK_MONOTONIC
  std::int64_t now_utc_ns = 0;
};

// With its '\n'.
void WriteStateLine(const StateLine& state, JsonLine& line);

}  // namespace viewfix
