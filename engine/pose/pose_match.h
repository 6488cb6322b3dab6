// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace viewfix {

// A key point of the frame and the landmark that it is taken for.
struct PoseMatch {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double sigma_px = 1;  // standard deviation of each coordinate of `pixel`, > 0
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();
};

}  // namespace viewfix
