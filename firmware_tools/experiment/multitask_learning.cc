// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/experiment/multitask_learning.h"

#include <cmath>
#include <functional>

#include "firmware_tools/experiment/spectral.h"

namespace viewfix {
namespace {

// y += factor * x; a loop that compilers vectorize.
void AddScaled(double factor, const double* x, Eigen::Index n, double* y) {
  for (Eigen::Index i = 0; i < n; ++i) y[i] += factor * x[i];
}

// log(1 + exp(-z)) without overflow.
double LogisticOf(double z) {
  return z > 0 ? std::log1p(std::exp(-z)) : -z + std::log1p(std::exp(z));
}

// Four sums side by side, whose order is stated: the same result everywhere.
double Dot(const double* a, const double* b, Eigen::Index n) {
  double sums[4] = {0, 0, 0, 0};
  Eigen::Index i = 0;
  for (; i + 4 <= n; i += 4) {
    for (int lane = 0; lane < 4; ++lane) sums[lane] += a[i + lane] * b[i + lane];
  }
  for (; i < n; ++i) sums[0] += a[i] * b[i];
  return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

// The loss of one task; adds to its gradients where asked for.
double TaskLoss(const LearningTask& task, const double* w, double b, double* w_gradient,
                double* b_gradient) {
  const Eigen::Index dim = task.samples.rows();
  const Eigen::Index n = task.samples.cols();
  const auto count = static_cast<double>(n);
  double loss = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double* x = task.samples.data() + i * dim;
    const double y = task.labels[i];
    const double margin = y * (Dot(x, w, dim) + b);
    loss += LogisticOf(margin) / count;
    if (w_gradient == nullptr) continue;
    const double slope = -y / (1 + std::exp(margin)) / count;
    AddScaled(slope, x, dim, w_gradient);
    *b_gradient += slope;
  }
  return loss;
}

Eigen::Index Dim(const std::vector<LearningTask>& tasks) { return tasks.front().samples.rows(); }

// A penalty's value at w; adds its gradient where asked for.
using Penalty = std::function<double(const Eigen::MatrixXd& w, Eigen::MatrixXd* gradient)>;

// min L(W, b) + penalty(W); the unknowns are [W; b].
MultitaskWeights SolveSmooth(const std::vector<LearningTask>& tasks, const Penalty& penalty,
                             const ProximalOptions& options) {
  const Eigen::Index dim = Dim(tasks);
  const auto count = static_cast<Eigen::Index>(tasks.size());
  ProximalProblem problem;
  problem.smooth = [&](const Eigen::MatrixXd& x, Eigen::MatrixXd* gradient) {
    const Eigen::MatrixXd w = x.topRows(dim);
    Eigen::MatrixXd w_gradient;
    Eigen::RowVectorXd b_gradient;
    const bool wanted = gradient != nullptr;
    const double loss = LogisticLoss(tasks, w, x.row(dim), wanted ? &w_gradient : nullptr,
                                     wanted ? &b_gradient : nullptr);
    const double value = loss + penalty(w, wanted ? &w_gradient : nullptr);
    if (wanted) {
      gradient->resize(dim + 1, count);
      *gradient << w_gradient, b_gradient;
    }
    return value;
  };
  const ProximalResult result =
      MinimizeProximal(problem, Eigen::MatrixXd::Zero(dim + 1, count), options);
  return {result.x.topRows(dim), result.x.row(dim), result.converged};
}

}  // namespace

double LogisticLoss(const std::vector<LearningTask>& tasks, const Eigen::MatrixXd& w,
                    const Eigen::RowVectorXd& b, Eigen::MatrixXd* w_gradient,
                    Eigen::RowVectorXd* b_gradient) {
  const bool wanted = w_gradient != nullptr;
  if (wanted) {
    w_gradient->setZero(w.rows(), w.cols());
    b_gradient->setZero(b.size());
  }
  double loss = 0;
  for (std::size_t t = 0; t < tasks.size(); ++t) {
    const auto col = static_cast<Eigen::Index>(t) * w.rows();
    loss += TaskLoss(tasks[t], w.data() + col, b[static_cast<Eigen::Index>(t)],
                     wanted ? w_gradient->data() + col : nullptr,
                     wanted ? b_gradient->data() + t : nullptr);
  }
  return loss;
}

SparseTraceWeights SolveSparseTrace(const std::vector<LearningTask>& tasks, double gamma,
                                    double tau, const ProximalOptions& options) {
  const Eigen::Index dim = Dim(tasks);
  const auto count = static_cast<Eigen::Index>(tasks.size());
  ProximalProblem problem;  // the unknowns are [P; Q; b]
  problem.smooth = [&](const Eigen::MatrixXd& x, Eigen::MatrixXd* gradient) {
    const Eigen::MatrixXd w = x.topRows(dim) + x.middleRows(dim, dim);
    if (gradient == nullptr) return LogisticLoss(tasks, w, x.row(2 * dim), nullptr, nullptr);
    Eigen::MatrixXd w_gradient;
    Eigen::RowVectorXd b_gradient;
    const double value = LogisticLoss(tasks, w, x.row(2 * dim), &w_gradient, &b_gradient);
    gradient->resize(2 * dim + 1, count);
    *gradient << w_gradient, w_gradient, b_gradient;
    return value;
  };
  problem.prox = [&](double step, Eigen::MatrixXd& x) {
    SoftThreshold(step * gamma, x.topRows(dim));
    x.middleRows(dim, dim) = ProjectToTraceBall(x.middleRows(dim, dim), tau);
  };
  const ProximalResult result =
      MinimizeProximal(problem, Eigen::MatrixXd::Zero(2 * dim + 1, count), options);
  SparseTraceWeights weights;
  weights.p = result.x.topRows(dim);
  weights.q = result.x.middleRows(dim, dim);
  weights.w = weights.p + weights.q;
  weights.b = result.x.row(2 * dim);
  weights.converged = result.converged;
  return weights;
}

MultitaskWeights SolveClustered(const std::vector<LearningTask>& tasks, double rho, double eta,
                                double k, const ProximalOptions& options) {
  const double scale = rho * (1 + eta);
  const auto penalty = [=](const Eigen::MatrixXd& w, Eigen::MatrixXd* gradient) {
    const ClusterPenalty omega = EvaluateClusterPenalty(w, eta, k);
    if (gradient != nullptr) *gradient += scale * omega.gradient;
    return scale * omega.value;
  };
  return SolveSmooth(tasks, penalty, options);
}

MultitaskWeights SolveStructure(const std::vector<LearningTask>& tasks, double rho, double eta,
                                double h, const ProximalOptions& options) {
  const double scale = rho * (1 + eta);
  const auto penalty = [=](const Eigen::MatrixXd& w, Eigen::MatrixXd* gradient) {
    const StructurePenalty omega = EvaluateStructurePenalty(w, eta, h);
    if (gradient != nullptr) *gradient += scale * omega.gradient;
    return scale * omega.value;
  };
  return SolveSmooth(tasks, penalty, options);
}

}  // namespace viewfix
