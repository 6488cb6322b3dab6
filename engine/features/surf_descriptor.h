// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/cpu_path.h"
#include "engine/features/feature_extractor.h"
#include "engine/image/integral_image.h"

namespace viewfix {

inline constexpr int kSurfDim = 64;

// Describes the square of 17 sigma about a key point, turned by its orientation:
// 4 x 4 subregions, row by row, each with (sum dx, sum dy, sum |dx|, sum |dy|)
// of Haar responses of side 2 sigma (section 4.2 of H. Bay et al., CVIU 2008). As
// in MU-SURF (section 4 of M. Agrawal et al., CenSurE, ECCV 2008), subregions of 9 x
// 9 samples overlap by 2 on each side, samples count by a Gaussian of 2.5 samples about
// the subregion's centre, and subregions by one of 1.5 subregions about the key point:
// small shifts change little. Samples are 0.7 sigma apart, not 1 as in the papers: the
// smaller square gave better visual words and as good matches. Scaled to length 127
// and rounded; all zero where there is no gradient. No heap. Thread-safe.
void DescribeSurf(const IntegralImage& image, const Keypoint& keypoint,
                  std::span<std::int8_t, kSurfDim> descriptor, CpuPath path = BestCpuPath());

}  // namespace viewfix
