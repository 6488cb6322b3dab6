// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "engine/base/aligned_vector.h"
#include "engine/image/image_view.h"

namespace viewfix {

// Sums of all pixels above and to the left, so that the sum over any rectangle
// takes four reads (F. Crow, Summed-area tables, SIGGRAPH 1984). The image is
// continued on all sides by `border` pixels, mirrored at its edges (c b a | a b
// c), so that filters can be placed on every pixel. Sums are counted from the image's own upper left
// corner, and go below zero beyond it.
//
// Corners, not pixels, have the coordinates: corner (x, y) is the upper left
// corner of pixel (x, y), at (x - 0.5, y - 0.5) where pixel centres are at
// integers. Values wrap modulo 2^32; a rectangle's sum is exact as long as it is
// below 2^31 itself (8.4 million white pixels).
//
// Memory is allocated by the constructor alone. One instance serves one thread.
class IntegralImage {
 public:
  // For images of up to max_side x max_side pixels; max_side >= 1, border >= 0.
  IntegralImage(int max_side, int border);

  // Both sides of `image` within 1..max_side.
  void Compute(const ImageView& image);

  int width() const { return width_; }    // pixels, without the border
  int height() const { return height_; }  // pixels, without the border
  int border() const { return border_; }

  // The corners (x, y), x in -border .. width + border; y in -border .. height +
  // border. Loops over whole vectors of 16 may begin at the last multiple of 16 before and read
  // to the first one after these, where values mean nothing. Each x = 0 begins a cache line.
  const std::uint32_t* Row(int y) const {
    return origin_ + static_cast<std::ptrdiff_t>(y) * row_length_;
  }

  // Sum of the pixels x0 <= x < x1, y0 <= y < y1.
  std::int32_t BoxSum(int x0, int y0, int x1, int y1) const {
    const std::uint32_t* top = Row(y0);
    const std::uint32_t* bottom = Row(y1);
    return static_cast<std::int32_t>(bottom[x1] - bottom[x0] - top[x1] + top[x0]);
  }

 private:
  [[maybe_unused]] int max_side_;  // for assertions alone
  int border_;
  int width_ = 0;
  int height_ = 0;
  int row_length_ = 0;
  AlignedVector<std::uint32_t> sums_;
  std::uint32_t* origin_ = nullptr;  // the corner (0, 0)
};

}  // namespace viewfix
