// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "engine/geometry/camera.h"
#include "engine/geometry/rigid3.h"
#include "engine/pose/pose_match.h"

namespace viewfix {

// Matches of one frame with the truth they were made from.
struct PoseProblem {
  Camera camera;
  Rigid3 cam_from_world;
  std::vector<PoseMatch> matches;
  std::vector<std::uint8_t> is_true;  // zero: a wrong match
};

struct PoseProblemOptions {
  int num_matches = 100;
  double share_true = 1;
  double noise = 1;  // of true matches, in their own sigma
};

inline Rigid3 RandomPose(std::mt19937& random) {
  std::uniform_real_distribution<double> unit(-1, 1);
  return {Eigen::Quaterniond(unit(random), unit(random), unit(random), unit(random)).normalized(),
          Eigen::Vector3d(10 * unit(random), 10 * unit(random), 2 * unit(random))};
}

// Landmarks 2 to 8 away over the whole image, sigmas of 0.5 to 2 pixels. Wrong matches point
// anywhere.
inline PoseProblem MakePoseProblem(const Camera& camera, const PoseProblemOptions& options,
                                   std::mt19937& random) {
  std::uniform_real_distribution<double> unit(0, 1);
  std::normal_distribution<double> normal(0, 1);
  const auto random_pixel = [&] {
    return Eigen::Vector2d(unit(random) * camera.width, unit(random) * camera.height);
  };
  PoseProblem problem{camera, RandomPose(random), {}, {}};
  while (static_cast<int>(problem.matches.size()) < options.num_matches) {
    PoseMatch match;
    Eigen::Vector3d bearing;
    match.pixel = random_pixel();
    match.sigma_px = 0.5 + 1.5 * unit(random);
    if (!camera.Unproject(match.pixel, bearing)) continue;
    match.point_in_world = Inverse(problem.cam_from_world) * ((2 + 6 * unit(random)) * bearing);
    const bool is_true = unit(random) < options.share_true;
    if (!is_true) match.pixel = random_pixel();
    match.pixel.x() += options.noise * match.sigma_px * normal(random);
    match.pixel.y() += options.noise * match.sigma_px * normal(random);
    problem.matches.push_back(match);
    problem.is_true.push_back(is_true);
  }
  return problem;
}

// The pose moved by about so much: a fair start for a refinement.
inline Rigid3 Disturbed(const Rigid3& cam_from_world, double metres, double radians,
                        std::mt19937& random) {
  std::normal_distribution<double> normal(0, 1);
  Rigid3 disturbed = cam_from_world;
  disturbed.translation += metres * Eigen::Vector3d(normal(random), normal(random), normal(random));
  const Eigen::Quaterniond turn(1, radians * normal(random), radians * normal(random),
                                radians * normal(random));
  disturbed.rotation = turn.normalized() * disturbed.rotation;
  return disturbed;
}

// [centre; left rotation vector] from the true world_from_cam to the estimated.
inline Eigen::Matrix<double, 6, 1> PoseError(const Rigid3& estimated_cam_from_world,
                                             const Rigid3& true_cam_from_world) {
  const Rigid3 estimated = Inverse(estimated_cam_from_world);
  const Rigid3 truth = Inverse(true_cam_from_world);
  const Eigen::AngleAxisd turn(estimated.rotation * truth.rotation.conjugate());
  Eigen::Matrix<double, 6, 1> error;
  error << estimated.translation - truth.translation, turn.angle() * turn.axis();
  return error;
}

}  // namespace viewfix
