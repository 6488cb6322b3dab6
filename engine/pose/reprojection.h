// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <span>

#include "engine/geometry/camera.h"
#include "engine/geometry/rigid3.h"
#include "engine/pose/pose_match.h"

namespace viewfix {

// The robust reprojection error of one frame, and what an adjustment needs of it.
//   cost = sum of rho(s_i),  s_i = |project(x_i) - pixel_i|^2 / sigma_i^2,
//   rho = Huber's: s below huber_sigma^2, 2 huber_sigma sqrt(s) - huber_sigma^2 above.
// A match that cannot be seen (behind the camera, a number not finite) costs as much as one
// that is kUnseenSigma off and pulls nowhere.
inline constexpr double kUnseenSigma = 1000;

// Where a camera stands, in the terms that an adjustment moves it by.
struct CameraState {
  Eigen::Vector3d centre_in_world;
  Eigen::Quaterniond world_from_cam;  // unit
  double focal_factor = 1;            // on fx and fy

  static CameraState From(const Rigid3& cam_from_world, double focal_factor = 1) {
    const Rigid3 world_from_cam = Inverse(cam_from_world);
    return {world_from_cam.translation, world_from_cam.rotation, focal_factor};
  }
  Rigid3 cam_from_world() const { return Inverse({world_from_cam, centre_in_world}); }

  // The state moved by [centre; rotation vector v]: the rotation is the unit quaternion along
  // [v / 2, 1], which is v to second order and needs no sine.
  CameraState MovedBy(const Eigen::Matrix<double, 6, 1>& step) const {
    const Eigen::Vector3d half = 0.5 * step.tail<3>();
    const Eigen::Quaterniond turn =
        Eigen::Quaterniond(1, half.x(), half.y(), half.z()).normalized();
    return {centre_in_world + step.head<3>(), (turn * world_from_cam).normalized(), focal_factor};
  }
};

// J'J, J'r and the cost about a state, by P parameters: [centre; left rotation vector of
// world_from_cam; focal factor if P = 7]. Sums run in the order of the matches. Eigen's own
// product of a tall matrix would block by the processor's caches, and so round differently
// from one to the next.
template <int P>
struct NormalEquations {
  Eigen::Matrix<double, P, P> information = Eigen::Matrix<double, P, P>::Zero();
  Eigen::Matrix<double, P, 1> gradient = Eigen::Matrix<double, P, 1>::Zero();
  double cost = 0;
  int num_seen = 0;
};

// One match's residual in units of sigma; its Jacobian if asked. False: not seen.
template <int P>
bool Reproject(const Camera& camera, const CameraState& state,
               const Eigen::Matrix3d& cam_from_world, const PoseMatch& match,
               Eigen::Vector2d& residual, Eigen::Matrix<double, 2, P>* jacobian) {
  const Eigen::Vector3d ray = match.point_in_world - state.centre_in_world;
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3> by_point;
  if (!camera.Project(cam_from_world * ray, pixel, jacobian ? &by_point : nullptr)) return false;
  const double weight = 1 / match.sigma_px;
  const Eigen::Vector2d from_centre(pixel.x() - camera.cx, pixel.y() - camera.cy);
  residual = weight * (from_centre * state.focal_factor + Eigen::Vector2d(camera.cx, camera.cy) -
                       match.pixel);
  if (!(residual.squaredNorm() < 1e30) || !(match.sigma_px > 0)) return false;
  if (jacobian != nullptr) {
    const Eigen::Matrix<double, 2, 3> by_world =
        (weight * state.focal_factor) * by_point.lazyProduct(cam_from_world);
    for (int row = 0; row < 2; ++row) {
      const Eigen::Vector3d g = by_world.row(row);
      jacobian->row(row).template head<3>() = -g;
      jacobian->row(row).template segment<3>(3) = g.cross(ray);
    }
    if constexpr (P == 7) jacobian->col(6) = weight * from_centre;
  }
  return true;
}

// rho(s) and its slope.
struct Loss {
  double value, slope;
};
inline Loss HuberLoss(double s, double huber_sigma) {
  if (s <= huber_sigma * huber_sigma) return {s, 1};
  const double r = std::sqrt(s);
  return {2 * huber_sigma * r - huber_sigma * huber_sigma, huber_sigma / r};
}

// The cost of matches about a state. `used`: empty for all, or one byte a match, zero to leave
// it out.
double ReprojectionCost(const Camera& camera, const CameraState& state,
                        std::span<const PoseMatch> matches, std::span<const std::uint8_t> used,
                        double huber_sigma);

// The same with what it takes to lower it. P is 6 or 7.
template <int P>
NormalEquations<P> BuildNormalEquations(const Camera& camera, const CameraState& state,
                                        std::span<const PoseMatch> matches,
                                        std::span<const std::uint8_t> used, double huber_sigma);

}  // namespace viewfix
