// SPDX-License-Identifier: BSD-3-Clause
#include "engine/image/integral_image.h"

#include <algorithm>
#include <cassert>
#include <cstddef>

namespace viewfix {
namespace {

// The pixel of 0..size-1 that mirroring at both edges, again and again if need
// be, puts at `i`.
int Mirror(int i, int size) {
  const int period = 2 * size;
  const int phase = ((i % period) + period) % period;
  return phase < size ? phase : period - 1 - phase;
}

void MirrorRow(const std::uint8_t* row, int width, int border, std::uint8_t* padded) {
  if (border <= width) {  // mirrored once
    std::reverse_copy(row, row + border, padded);
    std::copy_n(row, width, padded + border);
    std::reverse_copy(row + width - border, row + width, padded + border + width);
    return;
  }
  for (int x = -border; x < 0; ++x) padded[x + border] = row[Mirror(x, width)];
  std::copy_n(row, width, padded + border);
  for (int x = width; x < width + border; ++x) padded[x + border] = row[Mirror(x, width)];
}

}  // namespace

IntegralImage::IntegralImage(int max_side, int border)
    : max_side_(max_side),
      border_(border),
      sums_(std::size_t(max_side + 2 * border + 1) * (max_side + 2 * border + 1)),
      padded_row_(max_side + 2 * border) {}

void IntegralImage::Compute(const ImageView& image) {
  assert(!image.empty() && image.width <= max_side_ && image.height <= max_side_);
  width_ = image.width;
  height_ = image.height;
  row_length_ = width_ + 2 * border_ + 1;
  origin_ = sums_.data() + std::ptrdiff_t(border_) * row_length_ + border_;

  std::fill_n(sums_.data(), row_length_, 0U);
  for (int y = -border_; y < height_ + border_; ++y) {
    MirrorRow(image.Row(Mirror(y, height_)), width_, border_, padded_row_.data());
    const std::uint32_t* above = sums_.data() + std::ptrdiff_t(y + border_) * row_length_;
    std::uint32_t* sums = sums_.data() + std::ptrdiff_t(y + border_ + 1) * row_length_;
    std::uint32_t row_sum = 0;
    sums[0] = 0;
    for (int i = 0; i < row_length_ - 1; ++i) {
      row_sum += padded_row_[i];
      sums[i + 1] = above[i + 1] + row_sum;
    }
  }
}

}  // namespace viewfix
