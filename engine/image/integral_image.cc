// SPDX-License-Identifier: BSD-3-Clause
#include "engine/image/integral_image.h"

#include <algorithm>
#include <cassert>
#include <cstddef>

namespace viewfix {
namespace {

constexpr int kVector = 16;  // values of a cache line, and of the longest vector

// Left of x = 0.
int MarginLength(int border) { return (border + kVector - 1) / kVector * kVector; }

// An odd number of cache lines: rows below each other lie in different sets of the cache.
int RowLength(int width, int border) {
  return (MarginLength(border) + width + border + 1 + kVector - 1) / kVector * kVector | kVector;
}

void SumRow(const std::uint8_t* pixels, int width, const std::uint32_t* __restrict above,
            std::uint32_t* __restrict sums) {
  std::uint32_t row_sum = 0;
  sums[0] = 0;
  for (int x = 0; x < width; ++x) {
    row_sum += pixels[x];
    sums[x + 1] = above[x + 1] + row_sum;
  }
}

// Sums beyond a mirror are the ones before it, turned about the sum at the mirror itself.
void MirrorEnds(int width, int border, std::uint32_t* sums) {
  const std::uint32_t twice = 2 * sums[width];
  if (border > width) {  // mirrored again and again
    for (int i = 1; i <= border; ++i) {
      sums[-i] = 0 - sums[i];
      sums[width + i] = twice - sums[width - i];
    }
    return;
  }
  const std::uint32_t* __restrict inside = sums;
  std::uint32_t* __restrict left = sums - border;
  std::uint32_t* __restrict right = sums + width + 1;
  for (int i = 0; i < border; ++i) left[i] = 0 - inside[border - i];
  for (int i = 0; i < border; ++i) right[i] = twice - inside[width - 1 - i];
}

void MirrorRow(const std::uint32_t* __restrict inside, const std::uint32_t* __restrict mirror,
               int length, std::uint32_t* __restrict outside) {
  for (int i = 0; i < length; ++i) outside[i] = 2 * mirror[i] - inside[i];
}

}  // namespace

IntegralImage::IntegralImage(int max_side, int border)
    : max_side_(max_side),
      border_(border),
      sums_(std::size_t(max_side + 2 * border + 1) * RowLength(max_side, border) + kVector) {}

void IntegralImage::Compute(const ImageView& image) {
  assert(!image.empty() && image.width <= max_side_ && image.height <= max_side_);
  width_ = image.width;
  height_ = image.height;
  row_length_ = RowLength(width_, border_);
  origin_ = sums_.data() + std::ptrdiff_t(border_) * row_length_ + MarginLength(border_);

  const auto row = [&](int y) { return origin_ + std::ptrdiff_t(y) * row_length_; };
  std::fill_n(row(0) - border_, width_ + 2 * border_ + 1, 0U);
  for (int y = 0; y < height_; ++y) {
    SumRow(image.Row(y), width_, row(y), row(y + 1));
    MirrorEnds(width_, border_, row(y + 1));
  }
  for (int i = 1; i <= border_; ++i) {
    const int length = width_ + 2 * border_ + 1;
    MirrorRow(row(i) - border_, row(0) - border_, length, row(-i) - border_);
    MirrorRow(row(height_ - i) - border_, row(height_) - border_, length,
              row(height_ + i) - border_);
  }
}

}  // namespace viewfix
