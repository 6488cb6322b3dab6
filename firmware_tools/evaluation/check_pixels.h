// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/image/image_quality.h"
#include "firmware_tools/evaluation/check_set.h"

namespace viewfix {

// What one image's pixels tell.
struct ImagePixels {
  std::string unreadable;         // the cause; empty: read
  ImageQuality quality;           // shrunk to the side that features are found in
  std::uint64_t fingerprint = 0;  // of all its pixels
};

// Reads every image of the set, the test split included.
std::vector<ImagePixels> ReadPixels(const ImageSet& set, int max_image_side, int jobs,
                                    const Progress& progress);

// Images that cannot be read, and for each location those that are blurred, dark, overexposed.
std::vector<Finding> CheckPixels(const ImageSet& set, const std::vector<ImagePixels>& pixels);

// Files that hold the same picture.
std::vector<Finding> CheckDuplicates(const ImageSet& set, const std::vector<ImagePixels>& pixels);

// For each location, the readable images in which too few features were found.
std::vector<Finding> CheckFeatureless(const ImageSet& set, const FeatureStore& features,
                                      const std::vector<ImagePixels>& pixels);

}  // namespace viewfix
