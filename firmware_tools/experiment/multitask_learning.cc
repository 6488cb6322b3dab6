// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/experiment/multitask_learning.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>

#include "engine/base/cpu_path.h"
#include "firmware_tools/experiment/spectral.h"

namespace viewfix {
namespace {

// What a pass over the samples reads and adds to.
struct LossPass {
  const float* samples;  // [dim, count]
  const double* labels;  // [count, tasks]
  const double* shares;  // [tasks] 1 / n_t
  const double* w;       // [dim, tasks]
  const double* b;       // [tasks]
  Eigen::Index dim;
  Eigen::Index count;
  Eigen::Index tasks;
  double* w_gradient;  // null: not wanted
  double* b_gradient;
  double* loss;
  double* products;  // [tasks] room
};

constexpr int kLanes = 8;
// Side by side in as many registers as a path needs.
using Lanes [[gnu::vector_size(kLanes * sizeof(double))]] = double;
using FloatLanes [[gnu::vector_size(kLanes * sizeof(float))]] = float;

// Four samples at a time, so that a task's weights and gradient are read once for all of them.
constexpr int kBlock = 4;

struct LossKernel {
  VIEWFIX_KERNEL void Run(const LossPass* pass) {
    // The logarithms of a run of samples are that of one product: 512 factors of at most 2 do not
    // overflow.
    constexpr Eigen::Index kRun = 512;
    static_assert(kRun % kBlock == 0);
    for (Eigen::Index t = 0; t < pass->tasks; ++t) pass->products[t] = 1;
    for (Eigen::Index i = 0; i < pass->count; i += kBlock) {
      AddBlock(*pass, i, std::min<Eigen::Index>(i + kBlock, pass->count));
      if ((i + kBlock) % kRun != 0 && i + kBlock < pass->count) continue;
      for (Eigen::Index t = 0; t < pass->tasks; ++t) {
        *pass->loss += std::log(pass->products[t]) * pass->shares[t];
        pass->products[t] = 1;
      }
    }
  }

  VIEWFIX_KERNEL void AddBlock(const LossPass& pass, Eigen::Index begin, Eigen::Index end) {
    for (Eigen::Index t = 0; t < pass.tasks; ++t) {
      Eigen::Index samples[kBlock];
      int taken = 0;
      for (Eigen::Index i = begin; i < end; ++i) {
        if (pass.labels[t * pass.count + i] != 0) samples[taken++] = i;
      }
      if (taken == kBlock) {
        AddSamples<kBlock>(pass, t, samples);
      } else {
        for (int j = 0; j < taken; ++j) AddSamples<1>(pass, t, samples + j);
      }
    }
  }

  // log(1 + exp(-m)) = max(0, -m) + log(1 + e) with e = exp(-|m|).
  template <int kCount>
  VIEWFIX_KERNEL void AddSamples(const LossPass& pass, Eigen::Index t,
                                 const Eigen::Index* samples) {
    const float* x[kCount];
    for (int j = 0; j < kCount; ++j) x[j] = pass.samples + samples[j] * pass.dim;
    double scores[kCount];
    Dots<kCount>(x, pass.w + t * pass.dim, pass.dim, scores);
    double slopes[kCount];
    for (int j = 0; j < kCount; ++j) {
      const double y = pass.labels[t * pass.count + samples[j]];
      const double margin = y * (scores[j] + pass.b[t]);
      const double e = std::exp(-std::abs(margin));
      pass.products[t] *= 1 + e;
      *pass.loss += std::max(0.0, -margin) * pass.shares[t];
      slopes[j] = -y * (margin > 0 ? e : 1) / (1 + e) * pass.shares[t];
    }
    if (pass.w_gradient == nullptr) return;
    AddScaled<kCount>(slopes, x, pass.dim, pass.w_gradient + t * pass.dim);
    for (const double slope : slopes) pass.b_gradient[t] += slope;
  }

  // sums[j] = x[j]'w: in lanes side by side, whose order is stated, the same on every path.
  template <int kCount>
  VIEWFIX_KERNEL void Dots(const float* const (&x)[kCount], const double* w, Eigen::Index n,
                           double (&sums)[kCount]) {
    Lanes lanes[kCount] = {};
    Lanes weights;
    FloatLanes values;
    Eigen::Index i = 0;
    for (; i + kLanes <= n; i += kLanes) {
      std::memcpy(&weights, w + i, sizeof weights);
      for (int j = 0; j < kCount; ++j) {
        std::memcpy(&values, x[j] + i, sizeof values);
        lanes[j] += __builtin_convertvector(values, Lanes) * weights;
      }
    }
    for (int j = 0; j < kCount; ++j) {
      sums[j] = 0;
      for (Eigen::Index k = i; k < n; ++k) sums[j] += double{x[j][k]} * w[k];
      for (int l = 0; l < kLanes; ++l) sums[j] += lanes[j][l];
    }
  }

  // y += sum_j factors[j] x[j]
  template <int kCount>
  VIEWFIX_KERNEL void AddScaled(const double (&factors)[kCount], const float* const (&x)[kCount],
                                Eigen::Index n, double* y) {
    Lanes sum;
    FloatLanes values;
    Eigen::Index i = 0;
    for (; i + kLanes <= n; i += kLanes) {
      std::memcpy(&sum, y + i, sizeof sum);
      for (int j = 0; j < kCount; ++j) {
        std::memcpy(&values, x[j] + i, sizeof values);
        sum += factors[j] * __builtin_convertvector(values, Lanes);
      }
      std::memcpy(y + i, &sum, sizeof sum);
    }
    for (; i < n; ++i) {
      for (int j = 0; j < kCount; ++j) y[i] += factors[j] * double{x[j][i]};
    }
  }
};

Eigen::Index Dim(const LearningTasks& tasks) { return tasks.samples.rows(); }
Eigen::Index Count(const LearningTasks& tasks) { return tasks.labels.cols(); }

// A penalty's value at w; adds its gradient where asked for.
using Penalty = std::function<double(const Eigen::MatrixXd& w, Eigen::MatrixXd* gradient)>;

// min L(W, b) + penalty(W); the unknowns are [W; b].
MultitaskWeights SolveSmooth(const LearningTasks& tasks, const Penalty& penalty,
                             const ProximalOptions& options) {
  const Eigen::Index dim = Dim(tasks);
  const Eigen::Index count = Count(tasks);
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

double LogisticLoss(const LearningTasks& tasks, const Eigen::MatrixXd& w,
                    const Eigen::RowVectorXd& b, Eigen::MatrixXd* w_gradient,
                    Eigen::RowVectorXd* b_gradient) {
  const bool wanted = w_gradient != nullptr;
  if (wanted) {
    w_gradient->setZero(w.rows(), w.cols());
    b_gradient->setZero(b.size());
  }
  const Eigen::RowVectorXd shares = tasks.labels.cwiseAbs().colwise().sum().cwiseInverse();
  Eigen::RowVectorXd products(Count(tasks));
  double loss = 0;
  const LossPass pass = {tasks.samples.data(),
                         tasks.labels.data(),
                         shares.data(),
                         w.data(),
                         b.data(),
                         Dim(tasks),
                         tasks.samples.cols(),
                         Count(tasks),
                         wanted ? w_gradient->data() : nullptr,
                         wanted ? b_gradient->data() : nullptr,
                         &loss,
                         products.data()};
  RunOnPath<LossKernel>(BestCpuPath(), &pass);
  return loss;
}

SparseTraceWeights SolveSparseTrace(const LearningTasks& tasks, double gamma, double tau,
                                    const ProximalOptions& options) {
  const Eigen::Index dim = Dim(tasks);
  const Eigen::Index count = Count(tasks);
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

MultitaskWeights SolveClustered(const LearningTasks& tasks, double rho, double eta, double k,
                                const ProximalOptions& options) {
  const double scale = rho * (1 + eta);
  const auto penalty = [=](const Eigen::MatrixXd& w, Eigen::MatrixXd* gradient) {
    const ClusterPenalty omega = EvaluateClusterPenalty(w, eta, k);
    if (gradient != nullptr) *gradient += scale * omega.gradient;
    return scale * omega.value;
  };
  return SolveSmooth(tasks, penalty, options);
}

MultitaskWeights SolveStructure(const LearningTasks& tasks, double rho, double eta, double h,
                                const ProximalOptions& options) {
  const double scale = rho * (1 + eta);
  const auto penalty = [=](const Eigen::MatrixXd& w, Eigen::MatrixXd* gradient) {
    const StructurePenalty omega = EvaluateStructurePenalty(w, eta, h);
    if (gradient != nullptr) *gradient += scale * omega.gradient;
    return scale * omega.value;
  };
  return SolveSmooth(tasks, penalty, options);
}

}  // namespace viewfix
