// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/cpu_path.h"
#include "engine/features/feature_extractor.h"
#include "engine/image/image_view.h"
#include "engine/image/integral_image.h"
#include "engine/image/resize.h"

namespace viewfix {

// How colours differ about key points: the mean Cb and Cr of parts of a square of 16 sigma, turned
// by the orientation, each divided by the part's mean grey value, against each other. A colour's
// own value is left out, since a camera's white balance moves it, and each walk through a building
// has its own: it would tell walks apart, not places (decision 97). Gains of red and blue move all
// such quotients alike, nearly, and so their differences not.
//
// Memory is allocated by the constructor alone. One instance serves one thread.
class ChromaContrast {
 public:
  // For images of up to max_image_side pixels. Chroma of more than half of that is shrunk.
  explicit ChromaContrast(int max_image_side, CpuPath path = BestCpuPath());

  // What Describe() then describes. An image without chroma is one without contrasts.
  //   luma  of the image's grey values; must stay as it is until the last Describe()
  void Start(const ImageView& image, const IntegralImage& luma);

  // `numbers`: of the parts' quotients, in levels at a middling grey, for Cb and for Cr: lower less
  // upper half, right less left half, one diagonal's quarters less the other's, as an orthonormal
  // transform of the four quarters has them, in fifths of a level; and the middle less the whole,
  // in sevenths. Cut to a byte.
  void Describe(const Keypoint& keypoint, std::span<std::int8_t, kChromaDim> numbers) const;

 private:
  struct Plane {
    Shrinker shrinker;
    IntegralImage sums;
  };
  // A square part of the image: its middle and half its side, pixels.
  struct Part {
    float x;
    float y;
    float half;
  };

  static float MeanOf(const IntegralImage& sums, const Part& part, float columns_per_column,
                      float rows_per_row);

  Plane cb_;
  Plane cr_;
  const IntegralImage* luma_ = nullptr;  // null: no chroma is known
  float columns_per_column_ = 1;         // of chroma, for one of the image
  float rows_per_row_ = 1;
};

}  // namespace viewfix
