// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "firmware_tools/mapping/reconstruction.h"

namespace viewfix {

// One sight of a point, by a camera whose pose is known.
struct PointView {
  const Camera* camera = nullptr;
  const Rigid3* cam_from_world = nullptr;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  // of the camera, in the world
  Eigen::Vector3d ray = Eigen::Vector3d::Zero();     // unit, in the world; zero: none
  double max_error_px = 4;
};

PointView MakePointView(const Camera& camera, const Rigid3& cam_from_world,
                        const Eigen::Vector2d& pixel, double max_error_px);

// Reprojection error, pixels; infinite behind the camera.
double PointError(const PointView& view, const Eigen::Vector3d& point);

// Greatest angle at the point between the rays of two of the views, radians.
double WidestAngle(std::span<const PointView> views, const Eigen::Vector3d& point);

// Least squares of the reprojection errors (Cauchy's weights at half the greatest error),
// Gauss-Newton with damping. Returns the better of start and result.
Eigen::Vector3d RefinePoint(std::span<const PointView> views, const Eigen::Vector3d& start);

struct SolvedPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  std::vector<int> inliers;  // ascending, of the views given
};

// The point that most views agree on: proposed by pairs of views (all, or an even choice of
// them), refined, its inliers chosen again. None: fewer than two agree, or the widest angle
// between their rays is below min_angle (radians).
std::optional<SolvedPoint> SolvePoint(std::span<const PointView> views, double min_angle);

}  // namespace viewfix
