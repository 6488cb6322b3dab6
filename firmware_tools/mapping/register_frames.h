// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "firmware_tools/mapping/map_input.h"
#include "firmware_tools/mapping/reconstruction.h"
#include "firmware_tools/mapping/two_view.h"

namespace viewfix {

struct RegisterOptions {
  double max_error_px = 4;  // of an image of 640 pixels a side
  int min_inliers = 20;
  double min_inlier_share = 0.25;
  int seed = 1;
};

// Gives a pose to frames of `input` that have none and whose matches lead to enough points of the
// map (perspective-n-point in OpenCV's USAC). The map's images are the frames with a pose, in
// order, as TriangulateWithPoses() makes them. Returns how many frames were given one.
int RegisterFrames(const Reconstruction& map, std::span<const VerifiedPair> pairs,
                   const RegisterOptions& options, MapInput& input);

}  // namespace viewfix
