// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstdint>

#include "engine/image/integral_image.h"

namespace viewfix {

// Haar wavelet responses: right minus left and lower minus upper half of a
// square of 2 * half pixels about a corner of the pixel grid.
struct HaarResponse {
  std::int32_t dx;
  std::int32_t dy;
};

// The corner nearest to the point (x, y) is the middle (rounding up): centred
// squares have an even side. Squares are moved inside the image's border; half <=
// border.
inline HaarResponse Haar(const IntegralImage& image, float x, float y, int half) {
  const int border = image.border();
  // Positive before the cast, which truncates towards zero.
  const float shift = static_cast<float>(border) + 1;
  const float top_x = static_cast<float>(image.width() + 2 * border);
  const float top_y = static_cast<float>(image.height() + 2 * border);
  const int cx = std::clamp(static_cast<int>(std::clamp(x + shift, 0.0F, top_x)) - border,
                            half - border, image.width() + border - half);
  const int cy = std::clamp(static_cast<int>(std::clamp(y + shift, 0.0F, top_y)) - border,
                            half - border, image.height() + border - half);
  const std::uint32_t* top = image.Row(cy - half) + cx;
  const std::uint32_t* middle = image.Row(cy) + cx;
  const std::uint32_t* bottom = image.Row(cy + half) + cx;
  const std::uint32_t left_edge = bottom[-half] - top[-half];
  const std::uint32_t right_edge = bottom[half] - top[half];
  const std::uint32_t upper_edge = top[half] - top[-half];
  const std::uint32_t lower_edge = bottom[half] - bottom[-half];
  return {static_cast<std::int32_t>(right_edge + left_edge - 2 * (bottom[0] - top[0])),
          static_cast<std::int32_t>(lower_edge + upper_edge - 2 * (middle[half] - middle[-half]))};
}

}  // namespace viewfix
