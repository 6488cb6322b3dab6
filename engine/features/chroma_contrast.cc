// SPDX-License-Identifier: BSD-3-Clause
#include "engine/features/chroma_contrast.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace viewfix {
namespace {

// Of the IE Tower's training frames, each fifth held out (every third of them asked, whole
// descriptors), areas right / answered at 1 % wrong, and once the red of the frames asked is raised
// by 15 % and the blue lowered by 13 %: without chroma 90.2 / 71.7; undivided 91.2 / 83.4,
// then 89.3 / 72.1; divided by the grey value and 16 91.4 / 82.0, then 91.4 / 84.4; and 64 92.0
// / 83.4, then 91.0 / 79.9. Undivided, without the middle 91.2 / 77.5; with 4 x 4 parts, 30
// numbers, 91.6 / 82.2.
constexpr float kPerLevel = 5;
constexpr float kPerLevelOfMiddle = 7;
constexpr float kGreyAdded = 32;  // dark parts, of little but noise, count less
constexpr float kMiddleGrey = 110;
constexpr float kNeutral = 128;
constexpr float kQuarterSigmas = 4;  // from the key point to a quarter's middle, and its half side

std::int8_t Quantize(float value) {
  return static_cast<std::int8_t>(std::lround(std::clamp(value, -127.0F, 127.0F)));
}

// The nearest corner of the pixel grid inside 0 .. size.
int Corner(float position, int size) {
  return static_cast<int>(std::clamp(position, 0.0F, static_cast<float>(size)) + 0.5F);
}

}  // namespace

ChromaContrast::ChromaContrast(int max_image_side, CpuPath path)
    : cb_{Shrinker((max_image_side + 1) / 2, path), IntegralImage((max_image_side + 1) / 2, 0)},
      cr_{Shrinker((max_image_side + 1) / 2, path), IntegralImage((max_image_side + 1) / 2, 0)} {}

void ChromaContrast::Start(const ImageView& image, const IntegralImage& luma) {
  const ChromaView& chroma = image.chroma;
  luma_ = chroma.empty() ? nullptr : &luma;
  if (luma_ == nullptr) return;
  const auto sum = [&](const std::uint8_t* pixels, Plane& plane) {
    plane.sums.Compute(
        plane.shrinker.ShrinkToSide({pixels, chroma.width, chroma.height, chroma.row_bytes}));
  };
  sum(chroma.cb, cb_);
  sum(chroma.cr, cr_);
  columns_per_column_ = static_cast<float>(cb_.sums.width()) / static_cast<float>(image.width);
  rows_per_row_ = static_cast<float>(cb_.sums.height()) / static_cast<float>(image.height);
}

// Of as much of the part as lies in the image; of the pixel nearest to it where none of it does.
float ChromaContrast::MeanOf(const IntegralImage& sums, const Part& part, float columns_per_column,
                             float rows_per_row) {
  const auto range = [&](float centre, float scale, int size) {
    const int begin = std::min(Corner((centre + 0.5F - part.half) * scale, size), size - 1);
    const int end = Corner((centre + 0.5F + part.half) * scale, size);
    return std::pair(begin, std::max(end, begin + 1));
  };
  const auto [left, right] = range(part.x, columns_per_column, sums.width());
  const auto [top, bottom] = range(part.y, rows_per_row, sums.height());
  return static_cast<float>(sums.BoxSum(left, top, right, bottom)) /
         static_cast<float>((right - left) * (bottom - top));
}

void ChromaContrast::Describe(const Keypoint& keypoint,
                              std::span<std::int8_t, kChromaDim> numbers) const {
  std::fill(numbers.begin(), numbers.end(), std::int8_t{0});
  if (luma_ == nullptr) return;
  const float side = kQuarterSigmas * keypoint.sigma;
  const float along = keypoint.cos_angle * side, across = keypoint.sin_angle * side;
  const auto part = [&](float u, float v) {
    return Part{keypoint.x + u * along - v * across, keypoint.y + u * across + v * along, side};
  };
  const std::array<Part, 5> parts = {part(-1, -1), part(1, -1), part(-1, 1), part(1, 1),
                                     part(0, 0)};
  std::array<float, 5> factors;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    factors[p] = (kMiddleGrey + kGreyAdded) / (MeanOf(*luma_, parts[p], 1, 1) + kGreyAdded);
  }
  int i = 0;
  for (const IntegralImage* chroma : {&cb_.sums, &cr_.sums}) {
    std::array<float, 5> quotients;
    for (std::size_t p = 0; p < parts.size(); ++p) {
      const float mean = MeanOf(*chroma, parts[p], columns_per_column_, rows_per_row_);
      quotients[p] = (mean - kNeutral) * factors[p];
    }
    const auto [a, b, c, d, middle] = quotients;
    numbers[i++] = Quantize(kPerLevel / 2 * (c + d - a - b));
    numbers[i++] = Quantize(kPerLevel / 2 * (b + d - a - c));
    numbers[i++] = Quantize(kPerLevel / 2 * (a + d - b - c));
    numbers[i++] = Quantize(kPerLevelOfMiddle * (middle - (a + b + c + d) / 4));
  }
}

}  // namespace viewfix
