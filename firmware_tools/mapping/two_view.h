// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "firmware_tools/mapping/map_input.h"

namespace viewfix {

// Key points of two frames that show the same place.
struct FeatureMatch {
  int first_idx = 0;           // key point of the first frame
  int second_idx = 0;          // key point of the second
  std::int32_t distance2 = 0;  // between their descriptors
};

struct TwoViewOptions {
  float max_ratio = 0.8F;           // of distances to the nearest and second nearest descriptor
  double max_error_px = 1.5;        // from the epipolar line; of an image of 640 pixels a side
  double max_error_known_px = 3.0;  // the same under given poses, which have errors of their own
  int min_inliers = 15;
  int seed = 1;
};

// Two frames whose matches agree with one motion of the camera.
struct VerifiedPair {
  FramePair frames;
  std::vector<FeatureMatch> matches;  // by first_idx
  Rigid3 second_from_first;           // translation: of the given poses, else of length 1
  double median_angle_deg = 0;        // between the rays of a match: small means poor depth
};

// Matches frames (mutual nearest descriptors, ratio test) and keeps the pairs whose matches
// agree with the given poses of both frames or, where one is not given, with an essential
// matrix (OpenCV's USAC with MAGSAC's score). Ascending as `pairs` are; the same result
// whatever `jobs` is (0: all cores).
//   cache  keeps what each pair gave, or that it was refused, from run to run; null: nothing is
//   kept
std::vector<VerifiedPair> VerifyPairs(const MapInput& input, std::span<const FramePair> pairs,
                                      const TwoViewOptions& options, int jobs,
                                      const Progress& progress = {}, StageCache* cache = nullptr);

// Distance of a match from epipolar geometry, as an angle (radians, small): Sampson's, on
// the sphere of bearings.
double EpipolarError(const Rigid3& second_from_first, const Eigen::Vector3d& first,
                     const Eigen::Vector3d& second);

}  // namespace viewfix
