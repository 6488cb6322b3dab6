// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace viewfix {

// Pixels as a driver hands them over. Multi-planar formats with separate memory give their first
// plane, which holds the luma; their chroma is left out.
struct RawImage {
  std::uint32_t fourcc = 0;  // V4L2_PIX_FMT_...
  int width = 0;
  int height = 0;
  std::size_t row_bytes = 0;   // of the first plane; 0: rows without padding
  bool limited_range = false;  // luma 16..235 stands for black..white
  std::span<const std::uint8_t> bytes;
};

}  // namespace viewfix
