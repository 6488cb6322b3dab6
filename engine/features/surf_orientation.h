// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "engine/base/cpu_path.h"
#include "engine/features/feature_extractor.h"
#include "engine/image/integral_image.h"

namespace viewfix {

// Sets keypoint.cos_angle and sin_angle to the dominant direction of the grey
// gradient about the key point (section 4.1 of H. Bay et al., CVIU 2008): Haar
// responses of side 4 sigma at 113 places within 6 sigma, weighted by a Gaussian of
// 2.5 sigma, summed over a sliding window of 60 degrees in steps of 5; the
// longest sum wins. (1, 0) where there is no gradient. No heap. Thread-safe.
void AssignOrientation(const IntegralImage& image, Keypoint& keypoint,
                       CpuPath path = BestCpuPath());

}  // namespace viewfix
