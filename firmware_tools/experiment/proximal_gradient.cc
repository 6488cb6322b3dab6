// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/experiment/proximal_gradient.h"

#include <cmath>

namespace viewfix {
namespace {

// Differences of values below this are rounding: no reason to call a step too long.
constexpr double kRounding = 1e-14;
constexpr double kMaxCurvature = 1e12;

struct StepTaken {
  Eigen::MatrixXd x;
  double moved = 0;  // |x - from|
};

// One proximal step from `from`; raises `curvature` until it bounds the smooth part there.
StepTaken TakeStep(const ProximalProblem& problem, const Eigen::MatrixXd& from, double& curvature) {
  Eigen::MatrixXd gradient;
  const double value = problem.smooth(from, &gradient);
  while (true) {
    StepTaken step;
    step.x = from - gradient / curvature;
    if (problem.prox) problem.prox(1 / curvature, step.x);
    const Eigen::MatrixXd change = step.x - from;
    step.moved = change.norm();
    const double bound =
        value + gradient.cwiseProduct(change).sum() + curvature / 2 * step.moved * step.moved;
    const double slack = kRounding * (1 + std::abs(value));
    if (problem.smooth(step.x, nullptr) <= bound + slack || curvature > kMaxCurvature) return step;
    curvature *= 2;
  }
}

}  // namespace

ProximalResult MinimizeProximal(const ProximalProblem& problem, const Eigen::MatrixXd& start,
                                const ProximalOptions& options) {
  ProximalResult result;
  result.x = start;
  Eigen::MatrixXd ahead = start;
  double momentum = 1;
  double curvature = options.first_curvature;
  for (; result.iterations < options.max_iterations && !result.converged; ++result.iterations) {
    StepTaken step = TakeStep(problem, ahead, curvature);
    result.converged = curvature * step.moved <= options.tolerance;
    const bool uphill = (ahead - step.x).cwiseProduct(step.x - result.x).sum() > 0;
    const double next = uphill ? 1 : (1 + std::sqrt(1 + 4 * momentum * momentum)) / 2;
    const double carried = uphill ? 0 : (momentum - 1) / next;
    ahead = step.x + carried * (step.x - result.x);
    momentum = next;
    result.x = std::move(step.x);
  }
  return result;
}

}  // namespace viewfix
