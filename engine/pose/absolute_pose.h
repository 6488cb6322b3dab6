// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "engine/base/status.h"
#include "engine/geometry/camera.h"
#include "engine/pose/pose_match.h"
#include "engine/pose/pose_refiner.h"

namespace viewfix {

struct AbsolutePoseOptions {
  // Most matches of one frame, 3..65536: what Create() makes room for.
  int capacity = 4096;
  // A match is an inlier when its reprojection error is below this many sigmas, > 0. At 3.5,
  // 0.2 % of the right matches are lost (Rayleigh).
  double max_error_sigma = 3.5;
  // Least inliers of a pose that is called found, >= 4. Of 3000 frames of 30 to 1000 matches,
  // all wrong and anywhere, the best pose had 7 in one and fewer in the others. Things that
  // look alike agree in more: callers ask more where they know better.
  int min_inliers = 8;
  // Bounds of the samples drawn, 1 <= min <= max. Among 600 matches whose order says nothing,
  // 5000 find the pose in 100 frames of 100 at 15 % right ones, 95 at 10 %, 63 at 7 %; 20000 in
  // 100, 100 and 96, and take four times as long where there is no pose.
  int min_iterations = 30;
  int max_iterations = 5000;
  // Stop when the probability that all uniform samples so far held a wrong match, given the
  // inliers found, is below this; 0..1.
  double max_failure_probability = 1e-3;
  std::uint64_t seed = 1;
  PoseRefinerOptions refiner = {};

  Status Validate() const;
};

struct AbsolutePose {
  bool found = false;
  RefinedPose pose;     // over the inliers; its `found` is this one's
  int num_inliers = 0;  // of the best pose, also where they are too few
  double score = 0;     // sum over the inliers of 1 - (error / max_error)^2: MSAC
  int num_iterations = 0;
};

// Pose of a camera from 2D-3D matches, many of them wrong: locally optimized RANSAC [1] over
// SolveP3p(). Half of the samples are drawn uniformly, and they alone decide when to stop; the
// other half trust the order of the matches as PROSAC does [2], so that a good order saves
// time and a bad one does no harm. Poses are scored by MSAC on reprojection errors in sigmas,
// linear about each key point's ray, and given up early by a sequential test [3]. The best
// is refined over its inliers with the exact camera model.
// Create() allocates; Estimate() does not, is deterministic, and is bounded by max_iterations.
// One instance serves one thread.
// [1] O. Chum, J. Matas, J. Kittler, Locally Optimized RANSAC, DAGM 2003.
// [2] O. Chum, J. Matas, Matching with PROSAC, CVPR 2005.
// [3] J. Matas, O. Chum, Randomized RANSAC with Sequential Probability Ratio Test, ICCV 2005.
class AbsolutePoseEstimator {
 public:
  static Result<AbsolutePoseEstimator> Create(const AbsolutePoseOptions& options);
  AbsolutePoseEstimator(AbsolutePoseEstimator&&) noexcept;
  AbsolutePoseEstimator& operator=(AbsolutePoseEstimator&&) noexcept;
  ~AbsolutePoseEstimator();

  // `matches`: the most trusted first; those beyond the capacity are left out, those that are
  // not finite are never inliers. No pose is an outcome, not an error.
  AbsolutePose Estimate(const Camera& camera, std::span<const PoseMatch> matches);

  // One byte a match of the last Estimate(): 1 for an inlier of the pose. All zero if there
  // is none.
  std::span<const std::uint8_t> inliers() const;

 private:
  struct State;
  explicit AbsolutePoseEstimator(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace viewfix
