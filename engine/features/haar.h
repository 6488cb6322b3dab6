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
      : origin_(image.Row(-image.border()) - image.border()),
        row_length_(static_cast<int>(image.Row(1) - image.Row(0))),
        half_(half),
        border_(image.border()),
        width_(image.width()),
        height_(image.height()) {}

  // Whether no square about a point within `reach` of (x, y), either way along both axes,
  // needs to be moved to be inside the image's border.
  bool AreInside(float x, float y, float reach) const {
    const float margin = static_cast<float>(border_ - half_ - 1) - reach;  // a pixel to spare
    return x >= -margin && x <= static_cast<float>(width_) + margin && y >= -margin &&
           y <= static_cast<float>(height_) + margin;
  }

  // What At() takes: the place of the corner nearest to (x, y), rounding up, which is the middle
  // of the square (centred squares have an even side). Squares are moved inside the image's
  // border, for which kInside saves the time where AreInside().
  template <bool kInside>
  [[gnu::always_inline]] int Offset(float x, float y) const {
    return Middle<kInside>(y, height_) * row_length_ + Middle<kInside>(x, width_);
  }

  [[gnu::always_inline]] HaarResponse At(int offset) const {
    const std::uint32_t* middle = origin_ + offset;
    const std::uint32_t* top = middle - std::ptrdiff_t{half_} * row_length_;
    const std::uint32_t* bottom = middle + std::ptrdiff_t{half_} * row_length_;
    const std::uint32_t falling = bottom[half_] - top[-half_];
    const std::uint32_t rising = bottom[-half_] - top[half_];
    return {static_cast<std::int32_t>(falling + rising - 2 * (bottom[0] - top[0])),
            static_cast<std::int32_t>(falling - rising - 2 * (middle[half_] - middle[-half_]))};
  }

 private:
  // Counted from the border's edge.
  template <bool kInside>
  [[gnu::always_inline]] int Middle(float position, int size) const {
    // Positive before the cast, which truncates towards zero.
    const float shifted = position + static_cast<float>(border_ + 1);
    if constexpr (kInside) return static_cast<int>(shifted);
    const float top = static_cast<float>(size + 2 * border_);
    const float low = shifted < 0 ? 0 : shifted;
    const int cell = static_cast<int>(low > top ? top : low);
    return std::min(std::max(cell, half_), size + 2 * border_ - half_);
  }

  const std::uint32_t* origin_;  // the border's upper left corner
  int row_length_;
  int half_;
  int border_;
  int width_;
  int height_;
};

}  // namespace viewfix
