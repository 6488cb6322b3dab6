// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

namespace viewfix {

// Borrowed colour of an image: Cb and Cr as JPEG has them (ITU-R BT.601, full range, 128 is
// neutral), in two planes of one size that cover the image's whole field. Of any resolution: half
// the image's, mostly.
struct ChromaView {
  const std::uint8_t* cb = nullptr;
  const std::uint8_t* cr = nullptr;
  int width = 0;                 // pixels
  int height = 0;                // pixels
  std::ptrdiff_t row_bytes = 0;  // from one row to the next, >= width; of both planes

  bool empty() const { return width <= 0 || height <= 0 || cb == nullptr || cr == nullptr; }
};

// Borrowed 8-bit pixels, row by row: grey, and the colour where it is known. The owner outlives
// the view. Pixel centres are at integers: pixel (x, y) covers [x - 0.5, x + 0.5).
struct ImageView {
  const std::uint8_t* pixels = nullptr;
  int width = 0;                 // pixels
  int height = 0;                // pixels
  std::ptrdiff_t row_bytes = 0;  // from one row to the next, >= width
  ChromaView chroma = {};        // empty: not known

  const std::uint8_t* Row(int y) const { return pixels + y * row_bytes; }
  bool empty() const { return width <= 0 || height <= 0 || pixels == nullptr; }
};

// The largest image that any part of Viewfix accepts: 32-bit integral images
// hold 255 * 2^24 pixels without overflow.
inline constexpr int kMaxImageSide = 16384;
inline constexpr std::int64_t kMaxImagePixels = std::int64_t{1} << 24;

}  // namespace viewfix
