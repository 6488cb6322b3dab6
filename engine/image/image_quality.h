// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "engine/image/image_view.h"

namespace viewfix {

// How a photograph was taken, as far as its pixels tell.
struct ImageQuality {
  // Blur of edges, as the standard deviation of a Gaussian: pixels, 0.3..20. None: too few edges
  // to tell.
  std::optional<double> blur_px;
  double dark_share = 0;    // of the pixels, below 16 of 255
  double bright_share = 0;  // of the pixels, above 247 of 255
  double mean = 0;          // grey value, 0..255

  // What a human would call such an image, seen at about 640 pixels (measured: ARCHITECTURE.md).
  bool blurred() const;
  bool dark() const;
  bool overexposed() const;
};

// Blur by the gradient ratio of Zhuo and Sim, Defocus map estimation from a single image, Pattern
// Recognition 2011, with boxes in place of their Gaussians: across an edge of blur s, the pixels
// next to it differ by A erf(1 / (s sqrt 2)), the means of the eight on either side by
// A mean_k erf(k / (s sqrt 2)), so that the ratio of the two tells s, whatever the contrast A. That
// makes plain scenes comparable with rich ones. Taken along x and along y apart, the median over
// the strongest edges of each, and the larger of the two: motion blurs one direction only.
// Any size that the engine takes. Whole numbers up to the last division: the same on every
// processor. No heap.
ImageQuality MeasureQuality(const ImageView& image);

}  // namespace viewfix
