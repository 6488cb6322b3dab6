// SPDX-License-Identifier: BSD-3-Clause
#include "engine/image/resize.h"

#include <algorithm>
#include <cassert>
#include <cstddef>

#include "engine/base/cpu_path.h"

namespace viewfix {
namespace {

// A target row whose every pixel covers a square of whole ones.
template <int kSide>
struct SquaresKernel {
  VIEWFIX_KERNEL void Run(const std::uint8_t* first_row, std::ptrdiff_t row_bytes, int width,
                          std::uint8_t* out) {
    constexpr unsigned kArea = kSide * kSide;
    std::uint8_t* __restrict row = out;
    for (int x = 0; x < width; ++x) {
      unsigned sum = kArea / 2;
      for (int v = 0; v < kSide; ++v) {
        for (int u = 0; u < kSide; ++u) sum += first_row[v * row_bytes + x * kSide + u];
      }
      row[x] = static_cast<std::uint8_t>(sum / kArea);
    }
  }
};

template <int kSide>
void AverageSquares(CpuPath path, const ImageView& image, ImageSize target, std::uint8_t* pixels) {
  for (int y = 0; y < target.height; ++y) {
    RunOnPath<SquaresKernel<kSide>>(path, image.Row(y * kSide), image.row_bytes, target.width,
                                    pixels + std::size_t(y) * std::size_t(target.width));
  }
}

}  // namespace

// A side of `source` pixels becomes `target` pixels. Lengths are counted so that
// they are whole: a source pixel is `target` long, a target pixel `source`.

ImageSize ShrunkSize(int width, int height, int max_side) {
  const int longest = std::max(width, height);
  if (longest <= max_side) return {width, height};
  const auto shrink = [&](int side) {
    const std::int64_t rounded = (std::int64_t{2} * side * max_side + longest) / (2 * longest);
    return std::max(1, static_cast<int>(rounded));
  };
  return {shrink(width), shrink(height)};
}

Shrinker::Shrinker(int max_side, CpuPath path)
    : max_side_(max_side),
      path_(path),
      column_sums_(kMaxImageSide),
      pixels_(std::size_t(max_side) * std::size_t(max_side)) {}

void Shrinker::SumRows(const ImageView& image, int target_y, int target_height) {
  std::fill_n(column_sums_.begin(), image.width, 0U);
  const int begin = target_y * image.height;
  const int end = begin + image.height;
  for (int y = begin / target_height; y * target_height < end; ++y) {
    const int covered = std::min(end, (y + 1) * target_height) - std::max(begin, y * target_height);
    const auto weight = static_cast<std::uint32_t>(covered);
    const std::uint8_t* row = image.Row(y);
    for (int x = 0; x < image.width; ++x) column_sums_[x] += weight * row[x];
  }
}

void Shrinker::AverageColumns(const ImageView& image, ImageSize target, std::uint8_t* row) const {
  const std::uint64_t area = std::uint64_t(image.width) * std::uint64_t(image.height);
  for (int target_x = 0; target_x < target.width; ++target_x) {
    const int begin = target_x * image.width;
    const int end = begin + image.width;
    std::uint64_t sum = area / 2;
    for (int x = begin / target.width; x * target.width < end; ++x) {
      const int covered = std::min(end, (x + 1) * target.width) - std::max(begin, x * target.width);
      sum += std::uint64_t(covered) * column_sums_[x];
    }
    row[target_x] = static_cast<std::uint8_t>(sum / area);
  }
}

ImageView Shrinker::ShrinkToSide(const ImageView& image) {
  assert(!image.empty() && image.width <= kMaxImageSide && image.height <= kMaxImageSide);
  const ImageSize target = ShrunkSize(image.width, image.height, max_side_);
  if (target.width == image.width && target.height == image.height) return image;
  const auto is_times = [&](int side) {
    return target.width * side == image.width && target.height * side == image.height;
  };
  if (is_times(2)) {
    AverageSquares<2>(path_, image, target, pixels_.data());
  } else if (is_times(3)) {
    AverageSquares<3>(path_, image, target, pixels_.data());
  } else {
    AverageAreas(image, target);
  }
  return {pixels_.data(), target.width, target.height, target.width, image.chroma};
}

void Shrinker::AverageAreas(const ImageView& image, ImageSize target) {
  for (int y = 0; y < target.height; ++y) {
    SumRows(image, y, target.height);
    AverageColumns(image, target, pixels_.data() + std::size_t(y) * std::size_t(target.width));
  }
}

}  // namespace viewfix
