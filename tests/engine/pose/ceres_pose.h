// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include "engine/pose/pose_refiner.h"
#include "tests/engine/pose/pose_problem.h"

namespace viewfix {

// The pinhole camera once more, in Ceres' terms.
struct PinholeError {
  template <typename T>
  bool operator()(const T* turn, const T* translation, const T* focal_factor, T* residual) const {
    const T world[3] = {T(match.point_in_world.x()), T(match.point_in_world.y()),
                        T(match.point_in_world.z())};
    T p[3];
    ceres::AngleAxisRotatePoint(turn, world, p);
    for (int i = 0; i < 3; ++i) p[i] += translation[i];
    residual[0] =
        (*focal_factor * camera.fx * p[0] / p[2] + camera.cx - match.pixel.x()) / match.sigma_px;
    residual[1] =
        (*focal_factor * camera.fy * p[1] / p[2] + camera.cy - match.pixel.y()) / match.sigma_px;
    return true;
  }
  Camera camera;
  PoseMatch match;
};

struct FocalPrior {
  template <typename T>
  bool operator()(const T* focal_factor, T* residual) const {
    *residual = (*focal_factor - 1.0) / sigma;
    return true;
  }
  double sigma;
};

struct CeresSolution {
  bool usable = false;
  Rigid3 cam_from_world;
  double focal_factor = 1;
  double cost = 0;  // the sum of rho: twice what Ceres calls cost
};

// What RefinePose() solves, by all of Ceres.
//   tolerance  relative, of the cost and of the parameters: where it stops
inline CeresSolution SolveWithCeres(const PoseProblem& p, const Rigid3& start,
                                    const PoseRefinerOptions& options, double tolerance) {
  double turn[3], focal = 1;
  Eigen::Vector3d translation = start.translation;
  const double wxyz[4] = {start.rotation.w(), start.rotation.x(), start.rotation.y(),
                          start.rotation.z()};
  ceres::QuaternionToAngleAxis(wxyz, turn);
  ceres::Problem problem;
  for (const PoseMatch& match : p.matches) {
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PinholeError, 2, 3, 3, 1>(
                                 new PinholeError{p.camera, match}),
                             new ceres::HuberLoss(options.huber_sigma), turn, translation.data(),
                             &focal);
  }
  if (options.refine_focal) {
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<FocalPrior, 1, 1>(
                                 new FocalPrior{options.focal_prior_sigma}),
                             nullptr, &focal);
  } else {
    problem.SetParameterBlockConstant(&focal);
  }
  ceres::Solver::Options solver;
  solver.function_tolerance = tolerance;
  solver.parameter_tolerance = tolerance;
  solver.max_num_iterations = 200;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  double solved[4];
  ceres::AngleAxisToQuaternion(turn, solved);
  return {summary.IsSolutionUsable(),
          {Eigen::Quaterniond(solved[0], solved[1], solved[2], solved[3]), translation},
          focal,
          2 * summary.final_cost};
}

}  // namespace viewfix
