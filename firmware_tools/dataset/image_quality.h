// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "engine/image/image_view.h"

namespace viewfix {

// How a photograph was taken, as far as its pixels tell.
struct ImageQuality {
  // Blur of edges, as the standard deviation of a Gaussian: pixels. None: too few edges to tell.
  std::optional<double> blur_px;
  double dark_share = 0;    // of the pixels, below 16 of 255
  double bright_share = 0;  // of the pixels, above 247 of 255
  double mean = 0;          // grey value, 0..255
};

// Blur by the gradient ratio of Zhuo and Sim, Defocus map estimation from a single image, Pattern
// Recognition 2011: an edge of blur s, smoothed by t, has the peak gradient A / sqrt(2 pi (s^2 +
// t^2)), so that the ratio of its peaks under two smoothings t tells s, whatever its contrast.
// That makes plain scenes comparable with rich ones. Taken along x and along y apart, the median
// over the strongest edges of each, and the larger of the two: motion blurs one direction only.
// Any size; allocates.
ImageQuality MeasureQuality(const ImageView& image);

}  // namespace viewfix
