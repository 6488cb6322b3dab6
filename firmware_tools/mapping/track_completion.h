// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "firmware_tools/mapping/reconstruction.h"
#include "firmware_tools/training/feature_store.h"

namespace viewfix {

struct CompletionOptions {
  double max_error_px = 3.5;  // of an image of 640 pixels a side
  // Greatest distance of a key point's descriptor from the nearest one of the track;
  // descriptors have length 127.
  double max_descriptor_distance = 50;
  int jobs = 0;
};

// Looks for the points of a map where they must be seen: adds key points that lie at the
// projection, look alike and belong to no point; joins points that turn out to be one.
//   features [images] of the map's images; their key points are the images'
//   neighbours [images] images that may show the same
// Returns how many observations were added or joined. The same on any number of threads.
int CompleteTracks(Reconstruction& map, std::span<const ImageFeatures* const> features,
                   std::span<const std::vector<int>> neighbours, const CompletionOptions& options);

}  // namespace viewfix
