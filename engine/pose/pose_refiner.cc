// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pose/pose_refiner.h"

#include <ceres/tiny_solver.h>

#include <algorithm>
#include <cmath>

#include "engine/pose/reprojection.h"

namespace viewfix {
namespace {

constexpr int kMinMatches = 3;
// Of a diagonal element: what is left of it by the other parameters. Undetermined below.
constexpr double kMinPivot = 1e-13;

// Lower L with L L' = m. Pivots below kMinPivot of their element are raised to it; false then.
template <int P>
bool Cholesky(const Eigen::Matrix<double, P, P>& m, Eigen::Matrix<double, P, P>& lower) {
  bool definite = true;
  lower.setZero();
  for (int col = 0; col < P; ++col) {
    for (int row = col; row < P; ++row) {
      double sum = m(row, col);
      for (int k = 0; k < col; ++k) sum -= lower(row, k) * lower(col, k);
      if (row == col) {
        const double least = kMinPivot * m(col, col) + 1e-200;
        if (!(sum > least)) definite = false;
        lower(col, col) = std::sqrt(std::max(sum, least));
      } else {
        lower(row, col) = sum / lower(col, col);
      }
    }
  }
  return definite;
}

// L^-1 b
template <int P>
Eigen::Matrix<double, P, 1> ForwardSolve(const Eigen::Matrix<double, P, P>& lower,
                                         const Eigen::Matrix<double, P, 1>& b) {
  Eigen::Matrix<double, P, 1> x;
  for (int row = 0; row < P; ++row) {
    double sum = b[row];
    for (int k = 0; k < row; ++k) sum -= lower(row, k) * x[k];
    x[row] = sum / lower(row, row);
  }
  return x;
}

// The reprojection error as TinySolver takes it. All N matches together are P + 1 residuals f
// with the same cost f'f, gradient J'f and Gauss-Newton matrix J'J, so that the solver's work
// does not grow with N and its arrays stay small: J = [L'; 0], f = [L^-1 g; rest].
template <int P>
class CompressedReprojection {
 public:
  using Scalar = double;
  enum { NUM_RESIDUALS = P + 1, NUM_PARAMETERS = P };
  using Parameters = Eigen::Matrix<double, P, 1>;
  using Residuals = Eigen::Matrix<double, P + 1, 1>;
  using Jacobian = Eigen::Matrix<double, P + 1, P>;

  CompressedReprojection(const Camera& camera, std::span<const PoseMatch> matches,
                         std::span<const std::uint8_t> used, const CameraState& start,
                         const PoseRefinerOptions& options)
      : camera_(camera), matches_(matches), used_(used), start_(start), options_(options) {}

  CameraState StateAt(const Parameters& x) const {
    CameraState state = start_.MovedBy(x.template head<6>());
    if constexpr (P == 7) state.focal_factor += x[6];
    return state;
  }

  NormalEquations<P> EquationsAbout(const CameraState& state) const {
    auto sum = BuildNormalEquations<P>(camera_, state, matches_, used_, options_.huber_sigma);
    if constexpr (P == 7) {
      const double weight = 1 / options_.focal_prior_sigma;
      const double residual = weight * (state.focal_factor - 1);
      sum.information(6, 6) += weight * weight;
      sum.gradient[6] += weight * residual;
      sum.cost += residual * residual;
    }
    return sum;
  }

  bool operator()(const double* parameters, double* residuals, double* jacobian) const {
    const Parameters x = Eigen::Map<const Parameters>(parameters);
    Eigen::Map<Residuals> f(residuals);
    f.setZero();
    if (jacobian == nullptr) {
      f[P] = std::sqrt(CostAt(x));
      return true;
    }
    NormalEquations<P> sum = EquationsAbout(StateAt(x));
    TurnIntoParameters(x, sum);
    Eigen::Matrix<double, P, P> lower;
    Cholesky<P>(sum.information, lower);
    f.template head<P>() = ForwardSolve<P>(lower, sum.gradient);
    f[P] = std::sqrt(std::max(0.0, sum.cost - f.template head<P>().squaredNorm()));
    Eigen::Map<Jacobian> j(jacobian);
    j.setZero();
    j.template topRows<P>() = lower.transpose();
    return true;
  }

 private:
  double CostAt(const Parameters& x) const {
    const CameraState state = StateAt(x);
    double cost = ReprojectionCost(camera_, state, matches_, used_, options_.huber_sigma);
    if constexpr (P == 7) {
      const double residual = (state.focal_factor - 1) / options_.focal_prior_sigma;
      cost += residual * residual;
    }
    // A step to where numbers end is a step to refuse.
    return cost < 1e100 ? cost : 1e100;
  }

  // From rotation vectors about the moved state to those about the start: with a = v / 2 the
  // quaternion [a, 1] turns by (I + [a]x) dv / (1 + a'a) where v moves by dv.
  static void TurnIntoParameters(const Parameters& x, NormalEquations<P>& sum) {
    const Eigen::Vector3d a = 0.5 * x.template segment<3>(3);
    Eigen::Matrix3d turn;
    turn << 1, -a.z(), a.y(), a.z(), 1, -a.x(), -a.y(), a.x(), 1;
    turn /= 1 + a.squaredNorm();
    Eigen::Matrix<double, P, P> whole = Eigen::Matrix<double, P, P>::Identity();
    whole.template block<3, 3>(3, 3) = turn;
    const Eigen::Matrix<double, P, P> half = whole.transpose().lazyProduct(sum.information);
    sum.information = half.lazyProduct(whole);
    const Parameters gradient = whole.transpose().lazyProduct(sum.gradient);
    sum.gradient = gradient;
  }

  const Camera& camera_;
  std::span<const PoseMatch> matches_;
  std::span<const std::uint8_t> used_;
  CameraState start_;
  const PoseRefinerOptions& options_;
};

// The inverse of the information, its first six rows and columns. False: undetermined.
template <int P>
bool Covariance(const Eigen::Matrix<double, P, P>& information,
                Eigen::Matrix<double, 6, 6>& covariance) {
  Eigen::Matrix<double, P, P> lower;
  if (!information.allFinite() || !Cholesky<P>(information, lower)) return false;
  Eigen::Matrix<double, P, P> inverse_lower;
  for (int col = 0; col < P; ++col) {
    inverse_lower.col(col) = ForwardSolve<P>(lower, Eigen::Matrix<double, P, 1>::Unit(col));
  }
  covariance =
      inverse_lower.transpose().lazyProduct(inverse_lower).eval().template topLeftCorner<6, 6>();
  return covariance.allFinite();
}

int CountUsed(std::span<const PoseMatch> matches, std::span<const std::uint8_t> used) {
  if (used.empty()) return static_cast<int>(matches.size());
  return static_cast<int>(used.size() - std::count(used.begin(), used.end(), 0));
}

template <int P>
RefinedPose Refine(const Camera& camera, std::span<const PoseMatch> matches,
                   std::span<const std::uint8_t> used, const CameraState& start,
                   const PoseRefinerOptions& options) {
  using Problem = CompressedReprojection<P>;
  RefinedPose refined;
  const Problem problem(camera, matches, used, start, options);
  if (problem.EquationsAbout(start).num_seen < kMinMatches) return refined;

  ceres::TinySolver<Problem> solver;
  solver.options.max_num_iterations = options.max_iterations + 1;  // it counts its start
  typename Problem::Parameters x = Problem::Parameters::Zero();
  solver.Solve(problem, &x);
  if (!x.allFinite()) return refined;

  const CameraState state = problem.StateAt(x);
  const NormalEquations<P> sum = problem.EquationsAbout(state);
  const int used_count = CountUsed(matches, used);
  refined.cam_from_world = state.cam_from_world();
  refined.focal_factor = state.focal_factor;
  refined.cost = sum.cost;
  refined.residual_rms = std::sqrt(sum.cost / std::max(1, 2 * used_count - 6));
  refined.num_seen = sum.num_seen;
  refined.num_iterations = solver.summary.iterations;
  refined.found = sum.num_seen >= kMinMatches && std::isfinite(sum.cost) &&
                  state.focal_factor > 0 && Covariance<P>(sum.information, refined.covariance);
  return refined;
}

}  // namespace

Status PoseRefinerOptions::Validate() const {
  if (max_iterations < 1 || max_iterations > 100) {
    return Status(StatusCode::kInvalidArgument, "max_iterations is not 1..100");
  }
  if (!(huber_sigma > 0) || !(focal_prior_sigma > 0)) {
    return Status(StatusCode::kInvalidArgument, "a sigma of the refiner is not positive");
  }
  return {};
}

RefinedPose RefinePose(const Camera& camera, std::span<const PoseMatch> matches,
                       std::span<const std::uint8_t> used, const Rigid3& cam_from_world,
                       const PoseRefinerOptions& options) {
  if (!used.empty() && used.size() != matches.size()) return {};
  const CameraState start = CameraState::From(cam_from_world);
  return options.refine_focal ? Refine<7>(camera, matches, used, start, options)
                              : Refine<6>(camera, matches, used, start, options);
}

}  // namespace viewfix
