// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>

#include "engine/base/status.h"
#include "engine/geometry/camera.h"
#include "engine/geometry/rigid3.h"
#include "engine/pose/pose_match.h"

namespace viewfix {

struct PoseRefinerOptions {
  // Steps of Levenberg and Marquardt, 1..100. A start from RANSAC settles in 4 to 6.
  int max_iterations = 20;
  // Residuals beyond this many sigmas pull with a constant force (Huber), > 0. At 3, Gaussian
  // noise loses 1 % of its matches' weight, and a wrong match cannot bend the pose far.
  double huber_sigma = 3;
  // Also one factor on fx and fy, for a camera that is not calibrated.
  bool refine_focal = false;
  // Standard deviation of that factor about 1, > 0: all that holds it where the points lie in
  // a plane parallel to the image.
  double focal_prior_sigma = 0.3;

  Status Validate() const;
};

struct RefinedPose {
  bool found = false;
  Rigid3 cam_from_world;
  double focal_factor = 1;
  // Of [camera centre in world units; left rotation vector of world_from_cam in radians], given
  // that the matches' sigmas are what they say.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  double cost = 0;          // robust, in sigma^2
  double residual_rms = 0;  // in sigma per coordinate; 1 where sigmas are what they say
  int num_seen = 0;         // matches that the pose sees at all
  int num_iterations = 0;
};

// Local bundle adjustment of one camera: the pose, and on request the focal length, that
// minimizes the robust reprojection error of matches to landmarks that stay where they are,
// by Ceres' TinySolver. No heap, a bounded number of steps. Thread-safe.
//   matches         [N], N >= 3
//   used            empty for all, or [N], zero to leave a match out
//   cam_from_world  where to start
// Not found: fewer than 3 matches are in sight at the start or the end, they do not determine
// the pose, or the result is not finite. Matches that are not finite count as not in sight.
RefinedPose RefinePose(const Camera& camera, std::span<const PoseMatch> matches,
                       std::span<const std::uint8_t> used, const Rigid3& cam_from_world,
                       const PoseRefinerOptions& options);

}  // namespace viewfix
