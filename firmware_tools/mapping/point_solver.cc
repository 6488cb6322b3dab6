// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/point_solver.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace viewfix {
namespace {

constexpr int kMaxProposals = 24;
constexpr int kRounds = 3;

// The point nearest to two rays. None: nearly parallel, or behind a camera.
std::optional<Eigen::Vector3d> Midpoint(const PointView& a, const PointView& b) {
  const Eigen::Vector3d base = b.center - a.center;
  const double cosine = a.ray.dot(b.ray);
  const double sine2 = 1 - cosine * cosine;
  if (sine2 < 1e-8) return std::nullopt;
  const double depth_a = (base.dot(a.ray) - cosine * base.dot(b.ray)) / sine2;
  const double depth_b = (cosine * base.dot(a.ray) - base.dot(b.ray)) / sine2;
  if (depth_a <= 0 || depth_b <= 0) return std::nullopt;
  return 0.5 * (a.center + depth_a * a.ray + b.center + depth_b * b.ray);
}

std::vector<int> Inliers(std::span<const PointView> views, const Eigen::Vector3d& point) {
  std::vector<int> inliers;
  for (int i = 0; i < static_cast<int>(views.size()); ++i) {
    if (PointError(views[i], point) <= views[i].max_error_px) inliers.push_back(i);
  }
  return inliers;
}

// Truncated squares, in units of what is allowed: less is better.
double Cost(std::span<const PointView> views, const Eigen::Vector3d& point) {
  double cost = 0;
  for (const PointView& view : views) {
    const double error = PointError(view, point) / view.max_error_px;
    cost += std::min(1.0, error * error);
  }
  return cost;
}

std::vector<PointView> Select(std::span<const PointView> views, std::span<const int> idxs) {
  std::vector<PointView> selected;
  for (const int i : idxs) selected.push_back(views[i]);
  return selected;
}

// Proposals by pairs of views, an even choice where there are too many.
std::optional<Eigen::Vector3d> BestProposal(std::span<const PointView> views, double min_angle) {
  const int n = static_cast<int>(views.size());
  const int num_pairs = n * (n - 1) / 2;
  const int step = std::max(1, num_pairs / kMaxProposals);
  const double max_cosine = std::cos(min_angle);
  std::optional<Eigen::Vector3d> best;
  double best_cost = std::numeric_limits<double>::max();
  int pair = 0;
  for (int i = 0; i < n; ++i) {
    for (int j = i + 1; j < n; ++j, ++pair) {
      if (pair % step != 0 || views[i].ray.dot(views[j].ray) > max_cosine) continue;
      const auto point = Midpoint(views[i], views[j]);
      const double cost = point ? Cost(views, *point) : best_cost;
      if (cost >= best_cost) continue;
      best_cost = cost;
      best = point;
    }
  }
  return best;
}

// Normal equations of the weighted reprojection errors; returns their cost.
double Accumulate(std::span<const PointView> views, const Eigen::Vector3d& point,
                  Eigen::Matrix3d& hessian, Eigen::Vector3d& gradient) {
  hessian.setZero();
  gradient.setZero();
  double cost = 0;
  for (const PointView& view : views) {
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> in_cam;
    if (!view.camera->Project(*view.cam_from_world * point, pixel, &in_cam)) {
      return std::numeric_limits<double>::infinity();
    }
    const Eigen::Matrix<double, 2, 3> jacobian =
        in_cam * view.cam_from_world->rotation.toRotationMatrix();
    const Eigen::Vector2d residual = pixel - view.pixel;
    const double scale2 = 0.25 * view.max_error_px * view.max_error_px;
    const double weight = 1 / (1 + residual.squaredNorm() / scale2);
    cost += scale2 * std::log1p(residual.squaredNorm() / scale2);
    hessian += weight * jacobian.transpose() * jacobian;
    gradient += weight * jacobian.transpose() * residual;
  }
  return cost;
}

}  // namespace

PointView MakePointView(const Camera& camera, const Rigid3& cam_from_world,
                        const Eigen::Vector2d& pixel, double max_error_px) {
  PointView view{&camera, &cam_from_world, pixel, {}, {}, max_error_px};
  const Eigen::Quaterniond world_from_cam = cam_from_world.rotation.conjugate();
  view.center = -(world_from_cam * cam_from_world.translation);
  view.ray.setZero();
  Eigen::Vector3d bearing;
  if (camera.Unproject(pixel, bearing)) view.ray = world_from_cam * bearing;
  return view;
}

double PointError(const PointView& view, const Eigen::Vector3d& point) {
  Eigen::Vector2d pixel;
  if (!view.camera->Project(*view.cam_from_world * point, pixel)) {
    return std::numeric_limits<double>::infinity();
  }
  return (pixel - view.pixel).norm();
}

double WidestAngle(std::span<const PointView> views, const Eigen::Vector3d& point) {
  double least_cosine = 1;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Eigen::Vector3d a = (point - views[i].center).normalized();
    for (std::size_t j = i + 1; j < views.size(); ++j) {
      least_cosine = std::min(least_cosine, a.dot((point - views[j].center).normalized()));
    }
  }
  return std::acos(std::clamp(least_cosine, -1.0, 1.0));
}

Eigen::Vector3d RefinePoint(std::span<const PointView> views, const Eigen::Vector3d& start) {
  Eigen::Vector3d point = start;
  Eigen::Matrix3d hessian;
  Eigen::Vector3d gradient;
  double cost = Accumulate(views, point, hessian, gradient);
  double damping = 1e-4;
  for (int iteration = 0; iteration < 10 && std::isfinite(cost); ++iteration) {
    Eigen::Matrix3d damped = hessian;
    damped.diagonal() *= 1 + damping;
    const Eigen::Vector3d step = damped.ldlt().solve(gradient);
    if (!step.allFinite()) break;
    Eigen::Matrix3d new_hessian;
    Eigen::Vector3d new_gradient;
    const double new_cost = Accumulate(views, point - step, new_hessian, new_gradient);
    if (!(new_cost < cost)) {
      damping *= 100;
      continue;
    }
    const bool converged = cost - new_cost < 1e-6 * cost;
    point -= step;
    cost = new_cost;
    hessian = new_hessian;
    gradient = new_gradient;
    damping *= 0.1;
    if (converged) break;
  }
  return point;
}

std::optional<SolvedPoint> SolvePoint(std::span<const PointView> views, double min_angle) {
  const auto proposal = BestProposal(views, min_angle);
  if (!proposal) return std::nullopt;
  SolvedPoint solved{*proposal, Inliers(views, *proposal)};
  for (int round = 0; round < kRounds; ++round) {
    if (solved.inliers.size() < 2) return std::nullopt;
    solved.position = RefinePoint(Select(views, solved.inliers), solved.position);
    std::vector<int> inliers = Inliers(views, solved.position);
    if (inliers == solved.inliers) break;
    solved.inliers = std::move(inliers);
  }
  if (solved.inliers.size() < 2) return std::nullopt;
  if (WidestAngle(Select(views, solved.inliers), solved.position) < min_angle) return std::nullopt;
  return solved;
}

}  // namespace viewfix
