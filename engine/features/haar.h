// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "engine/image/integral_image.h"

namespace viewfix {

// Haar wavelet responses: right minus left and lower minus upper half of a
// square of 2 * half pixels about a corner of the pixel grid.
struct HaarResponse {
  std::int32_t dx;
  std::int32_t dy;
};

// Squares of one size on one image.
class HaarSquares {
 public:
  // 1 <= half <= border of the image.
  HaarSquares(const IntegralImage& image, int half)
      : origin_(image.Row(0)),
        row_length_(static_cast<int>(image.Row(1) - image.Row(0))),
        half_(half),
        border_(image.border()),
        width_(image.width()),
        height_(image.height()) {}

  // The corner nearest to a point is the middle (rounding up): centred squares have an
  // even side. Squares are moved inside the image's border.
  [[gnu::always_inline]] int MiddleX(float x) const { return Middle(x, width_); }
  [[gnu::always_inline]] int MiddleY(float y) const { return Middle(y, height_); }
  // What At() takes.
  [[gnu::always_inline]] int Offset(int middle_x, int middle_y) const {
    return middle_y * row_length_ + middle_x;
  }

  [[gnu::always_inline]] HaarResponse At(int offset) const {
    const std::uint32_t* middle = origin_ + offset;
    const std::uint32_t* top = middle - std::ptrdiff_t{half_} * row_length_;
    const std::uint32_t* bottom = middle + std::ptrdiff_t{half_} * row_length_;
    const std::uint32_t left_edge = bottom[-half_] - top[-half_];
    const std::uint32_t right_edge = bottom[half_] - top[half_];
    const std::uint32_t upper_edge = top[half_] - top[-half_];
    const std::uint32_t lower_edge = bottom[half_] - bottom[-half_];
    return {
        static_cast<std::int32_t>(right_edge + left_edge - 2 * (bottom[0] - top[0])),
        static_cast<std::int32_t>(lower_edge + upper_edge - 2 * (middle[half_] - middle[-half_]))};
  }

 private:
  [[gnu::always_inline]] int Middle(float position, int size) const {
    // Positive before the cast, which truncates towards zero.
    const float shift = static_cast<float>(border_) + 1;
    const float top = static_cast<float>(size + 2 * border_);
    const float shifted = position + shift;
    const float low = shifted < 0 ? 0 : shifted;
    const int cell = static_cast<int>(low > top ? top : low) - border_;
    return std::min(std::max(cell, half_ - border_), size + border_ - half_);
  }

  const std::uint32_t* origin_;
  int row_length_;
  int half_;
  int border_;
  int width_;
  int height_;
};

}  // namespace viewfix
