// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/experiment/multitask_learning.h"

#include <gtest/gtest.h>

#include <Eigen/SVD>
#include <cmath>
#include <random>

#include "firmware_tools/experiment/spectral.h"

namespace viewfix {
namespace {

constexpr int kDim = 12;
constexpr int kTasks = 3;

// Three tasks of 40 samples, a quarter of them positive, that overlap.
LearningTasks MakeTasks(int count = kTasks) {
  std::mt19937 random(11);
  const auto uniform = [&] { return static_cast<double>(random()) * 0x1p-31 - 1; };
  LearningTasks tasks = {Eigen::MatrixXf(kDim, 40 * count),
                         Eigen::MatrixXd::Zero(40 * count, count)};
  for (int i = 0; i < 40 * count; ++i) {
    const int t = i / 40;
    tasks.labels(i, t) = i % 4 == 0 ? 1 : -1;
    for (int d = 0; d < kDim; ++d) {
      const double shift = i % 4 == 0 ? (d < 3 ? 0.5 : 0) + (d == 3 + t ? 0.5 : 0) : 0;
      tasks.samples(d, i) = static_cast<float>(uniform() + shift);
    }
  }
  return tasks;
}

struct Gradient {
  Eigen::MatrixXd w;
  Eigen::RowVectorXd b;
};

Gradient LossGradient(const LearningTasks& tasks, const MultitaskWeights& weights) {
  Gradient gradient;
  LogisticLoss(tasks, weights.w, weights.b, &gradient.w, &gradient.b);
  return gradient;
}

double LargestSingularValue(const Eigen::MatrixXd& x) {
  return Eigen::JacobiSVD<Eigen::MatrixXd>(x).singularValues()[0];
}

TEST(LogisticLoss, GradientIsNumeric) {
  const auto tasks = MakeTasks();
  std::mt19937 random(12);
  MultitaskWeights at = {Eigen::MatrixXd(kDim, kTasks), Eigen::RowVectorXd::Constant(kTasks, 0.2),
                         true};
  for (Eigen::Index i = 0; i < at.w.size(); ++i)
    at.w.data()[i] = static_cast<double>(random()) * 0x1p-31 - 1;
  const Gradient gradient = LossGradient(tasks, at);
  const auto loss = [&] { return LogisticLoss(tasks, at.w, at.b, nullptr, nullptr); };
  for (Eigen::Index i = 0; i < at.w.size(); ++i) {
    double& x = at.w.data()[i];
    x += 1e-6;
    const double more = loss();
    x -= 2e-6;
    EXPECT_NEAR(gradient.w.data()[i], (more - loss()) / 2e-6, 1e-8);
    x += 1e-6;
  }
}

// Samples in several tasks or none, more than one run of them, margins beyond what exp() can hold.
TEST(LogisticLoss, IsTheSumOfEachTasksMean) {
  constexpr int kSamples = 1031;
  std::mt19937 random(13);
  const auto uniform = [&] { return static_cast<double>(random()) * 0x1p-31 - 1; };
  LearningTasks tasks = {Eigen::MatrixXf(kDim, kSamples), Eigen::MatrixXd::Zero(kSamples, 2)};
  for (Eigen::Index i = 0; i < tasks.samples.size(); ++i)
    tasks.samples.data()[i] = static_cast<float>(uniform());
  for (int i = 0; i < kSamples; ++i) {
    if (i % 3 != 0) tasks.labels(i, 0) = i % 5 == 0 ? 1 : -1;
    if (i % 7 < 4 || i < 600) tasks.labels(i, 1) = i % 2 == 0 ? 1 : -1;
  }
  Eigen::MatrixXd w(kDim, 2);
  for (int d = 0; d < kDim; ++d) w.row(d) << uniform(), 1000 * uniform();
  const Eigen::RowVector2d b(0.3, -0.1);
  double expected = 0;
  for (int t = 0; t < 2; ++t) {
    double sum = 0;
    for (int i = 0; i < kSamples; ++i) {
      const double margin =
          tasks.labels(i, t) * (tasks.samples.col(i).cast<double>().dot(w.col(t)) + b[t]);
      if (tasks.labels(i, t) != 0) {
        sum += std::max(0.0, -margin) + std::log1p(std::exp(-std::abs(margin)));
      }
    }
    expected += sum / tasks.labels.col(t).cwiseAbs().sum();
  }
  EXPECT_NEAR(LogisticLoss(tasks, w, b, nullptr, nullptr), expected, 1e-10 * expected);
}

// The gap of a convex problem is at most <gradient, x - x*> over both blocks, whose worst x* are
// known in closed form.
TEST(SolveSparseTrace, IsFeasibleAndOptimal) {
  const auto tasks = MakeTasks();
  for (const double gamma : {0.003, 0.03}) {
    for (const double tau : {0.3, 2.0}) {
      const SparseTraceWeights weights = SolveSparseTrace(tasks, gamma, tau, {});
      EXPECT_TRUE(weights.converged);
      const Gradient g = LossGradient(tasks, weights);
      EXPECT_LE(TraceNorm(weights.q), tau + 1e-9);
      EXPECT_LE(g.b.cwiseAbs().maxCoeff(), 1e-6);
      EXPECT_LE(g.w.cwiseAbs().maxCoeff(), gamma + 1e-6);
      const double p_gap = g.w.cwiseProduct(weights.p).sum() + gamma * weights.p.cwiseAbs().sum();
      const double q_gap = g.w.cwiseProduct(weights.q).sum() + tau * LargestSingularValue(g.w);
      EXPECT_LE(p_gap, 1e-5);
      EXPECT_LE(q_gap, 1e-5);
    }
  }
}

// Neither part is let in: the bias is the logarithm of the odds.
TEST(SolveSparseTrace, WithoutWeightsTheBiasIsTheLogOdds) {
  const SparseTraceWeights weights = SolveSparseTrace(MakeTasks(), 1e3, 0, {});
  EXPECT_EQ(weights.w.norm(), 0);
  for (int t = 0; t < kTasks; ++t) EXPECT_NEAR(weights.b[t], std::log(10.0 / 30.0), 1e-5);
}

TEST(SolveSparseTrace, LargeGammaLeavesLowRankAloneAndNoTraceSparseAlone) {
  const SparseTraceWeights low_rank = SolveSparseTrace(MakeTasks(), 1e3, 1, {});
  EXPECT_EQ(low_rank.p.norm(), 0);
  EXPECT_NEAR(TraceNorm(low_rank.q), 1, 1e-9);
  const SparseTraceWeights sparse = SolveSparseTrace(MakeTasks(), 0.02, 0, {});
  EXPECT_LT(sparse.q.norm(), 1e-12);
  EXPECT_GT((sparse.p.array() == 0).count(), 0);
}

// The problem is 2 rho eta-strongly convex in W: |gradient|^2 / (4 rho eta) bounds the gap.
TEST(SolveClustered, IsOptimal) {
  const auto tasks = MakeTasks();
  for (const double eta : {0.1, 1.0}) {
    for (const double k : {1.0, 2.0}) {
      const double rho = 0.01;
      const MultitaskWeights weights = SolveClustered(tasks, rho, eta, k, {});
      EXPECT_TRUE(weights.converged);
      Gradient g = LossGradient(tasks, weights);
      g.w += rho * (1 + eta) * EvaluateClusterPenalty(weights.w, eta, k).gradient;
      EXPECT_LE(g.w.squaredNorm() / (4 * rho * eta), 1e-5);
      EXPECT_LE(g.b.norm(), 1e-6);
    }
  }
}

TEST(SolveClustered, AllClustersOrOneTaskIsRidge) {
  for (const int count : {1, kTasks}) {
    const auto tasks = MakeTasks(count);
    const MultitaskWeights weights = SolveClustered(tasks, 0.01, 0.5, count, {});
    const Gradient g = LossGradient(tasks, weights);
    EXPECT_LT((g.w + 2 * 0.01 * weights.w).norm(), 1e-6);
  }
}

// One cluster ties the tasks together: closer to their mean than ridge alone has them.
TEST(SolveClustered, OneClusterBringsTasksTogether) {
  const auto spread = [](const MultitaskWeights& weights) {
    const Eigen::VectorXd mean = weights.w.rowwise().mean();
    return (weights.w.colwise() - mean).norm() / mean.norm();
  };
  const auto tasks = MakeTasks();
  EXPECT_LT(spread(SolveClustered(tasks, 0.01, 0.1, 1, {})),
            spread(SolveClustered(tasks, 0.01, 0.1, kTasks, {})));
}

// Zhou, Chen, Ye (2011): the two relaxations are one problem.
TEST(SolveStructure, AgreesWithSolveClustered) {
  const auto tasks = MakeTasks();
  for (const double budget : {1.0, 2.0}) {
    const MultitaskWeights structure = SolveStructure(tasks, 0.01, 0.3, budget, {});
    const MultitaskWeights clustered = SolveClustered(tasks, 0.01, 0.3, budget, {});
    EXPECT_TRUE(structure.converged);
    EXPECT_LT((structure.w - clustered.w).norm(), 1e-4);
    Gradient g = LossGradient(tasks, structure);
    g.w += 0.01 * 1.3 * EvaluateStructurePenalty(structure.w, 0.3, budget).gradient;
    EXPECT_LE(g.w.squaredNorm() / (4 * 0.01 * 0.3), 1e-5);
  }
}

}  // namespace
}  // namespace viewfix
