// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/experiment/spectral.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <cmath>
#include <random>

namespace viewfix {
namespace {

Eigen::MatrixXd Random(int rows, int cols, unsigned seed) {
  std::mt19937 random(seed);
  Eigen::MatrixXd x(rows, cols);
  for (Eigen::Index i = 0; i < x.size(); ++i)
    x.data()[i] = static_cast<double>(random()) * 0x1p-31 - 1;
  return x;
}

// Optimality of p = prox(x) for |.|_1: (x - p) / t is a subgradient at p.
TEST(SoftThreshold, IsTheProximalOperatorOfTheL1Norm) {
  const Eigen::MatrixXd x = Random(30, 4, 1);
  Eigen::MatrixXd p = x;
  SoftThreshold(0.3, p);
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const double subgradient = (x.data()[i] - p.data()[i]) / 0.3;
    EXPECT_LE(std::abs(subgradient), 1 + 1e-12);
    if (p.data()[i] != 0) {
      EXPECT_NEAR(subgradient, p.data()[i] > 0 ? 1 : -1, 1e-12);
    }
  }
}

// Optimality of a projection onto a convex set: <x - p, z - p> <= 0 for all z in it; the worst z
// of the trace-norm ball is radius * u v' of the greatest singular value of x - p.
TEST(ProjectToTraceBall, IsFeasibleAndOptimal) {
  for (const auto& [rows, cols] : {std::pair(40, 3), std::pair(3, 3), std::pair(2, 5)}) {
    const Eigen::MatrixXd x = 3 * Random(rows, cols, 2);
    for (const double radius : {0.5, 2.0, 6.0}) {
      const Eigen::MatrixXd p = ProjectToTraceBall(x, radius);
      EXPECT_LE(TraceNorm(p), radius + 1e-10);
      const Eigen::MatrixXd rest = x - p;
      const double worst = Eigen::JacobiSVD<Eigen::MatrixXd>(rest).singularValues()[0];
      EXPECT_LE(radius * worst - rest.cwiseProduct(p).sum(), 1e-9);
    }
    EXPECT_EQ(ProjectToTraceBall(x, 1e3), x);
    EXPECT_LT(ProjectToTraceBall(x, 0).norm(), 1e-12);
  }
}

TEST(TraceNorm, OfAnOuterProductIsTheProductOfNorms) {
  const Eigen::VectorXd u = Random(20, 1, 3);
  const Eigen::VectorXd v = Random(4, 1, 4);
  EXPECT_NEAR(TraceNorm(u * v.transpose()), u.norm() * v.norm(), 1e-12);
}

double BudgetValue(const Eigen::VectorXd& s, const Eigen::VectorXd& m, double eta) {
  return (s.array().square() / (m.array() + eta)).sum();
}

TEST(SpendBudget, IsFeasibleAndNothingFeasibleIsBetter) {
  std::mt19937 random(5);
  for (const double eta : {0.01, 0.3, 1.0, 20.0}) {
    for (const double budget : {0.2, 1.0, 2.5, 4.0}) {
      const Eigen::VectorXd s = Random(5, 1, static_cast<unsigned>(random())).cwiseAbs();
      const Eigen::VectorXd m = SpendBudget(s, eta, budget);
      EXPECT_NEAR(m.sum(), budget, 1e-9);
      EXPECT_GE(m.minCoeff(), 0);
      EXPECT_LE(m.maxCoeff(), 1);
      // The slope of the value along a transfer from j to i is not downhill.
      const Eigen::VectorXd gain = s.array().square() / (m.array() + eta).square();
      for (int i = 0; i < 5; ++i) {
        for (int j = 0; j < 5; ++j) {
          if (m[i] < 1 - 1e-12 && m[j] > 1e-12) {
            EXPECT_LE(gain[i], gain[j] * (1 + 1e-8));
          }
        }
      }
      EXPECT_LE(BudgetValue(s, m, eta),
                BudgetValue(s, Eigen::VectorXd::Constant(5, budget / 5), eta) + 1e-12);
    }
  }
}

TEST(SpendBudget, SpecialCases) {
  const Eigen::VectorXd s = (Eigen::VectorXd(3) << 2, 0, 1).finished();
  EXPECT_EQ(SpendBudget(s, 0.1, 3), Eigen::VectorXd::Ones(3));
  EXPECT_EQ(SpendBudget(s, 0.1, 2), (Eigen::VectorXd(3) << 1, 0, 1).finished());
  EXPECT_NEAR(SpendBudget(Eigen::VectorXd::Zero(4), 1, 2).sum(), 2, 1e-12);
}

// tr(W (eta I + M)^-1 W'), as written.
double ClusterValue(const Eigen::MatrixXd& w, const Eigen::MatrixXd& m, double eta) {
  const Eigen::MatrixXd a = m + eta * Eigen::MatrixXd::Identity(m.rows(), m.cols());
  return (w * a.inverse() * w.transpose()).trace();
}

TEST(ClusterPenalty, MIsFeasibleAndOptimal) {
  const Eigen::MatrixXd w = Random(12, 4, 6);
  for (const double eta : {0.1, 1.0}) {
    for (const double k : {1.0, 2.0, 3.0}) {
      const ClusterPenalty penalty = EvaluateClusterPenalty(w, eta, k);
      const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(penalty.m);
      EXPECT_GE(eigen.eigenvalues().minCoeff(), -1e-12);
      EXPECT_LE(eigen.eigenvalues().maxCoeff(), 1 + 1e-12);
      EXPECT_NEAR(penalty.m.trace(), k, 1e-9);
      EXPECT_NEAR(penalty.value, ClusterValue(w, penalty.m, eta), 1e-9 * penalty.value);
      // The gap to the best M: least of <G, N> over feasible N is the sum of the k smallest
      // eigenvalues of the gradient G = -A^-1 W'W A^-1.
      const Eigen::MatrixXd a = (penalty.m + eta * Eigen::MatrixXd::Identity(4, 4)).inverse();
      const Eigen::MatrixXd g = -a * w.transpose() * w * a;
      const Eigen::VectorXd slopes =
          Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(g).eigenvalues();
      const double least = slopes.head(static_cast<int>(k)).sum();
      EXPECT_LE(g.cwiseProduct(penalty.m).sum() - least, 1e-5 * penalty.value);
    }
  }
}

template <typename Evaluate>
void ExpectGradient(const Evaluate& evaluate) {
  const Eigen::MatrixXd w = Random(6, 3, 7);
  const Eigen::MatrixXd gradient = evaluate(w).gradient;
  for (Eigen::Index i = 0; i < w.size(); ++i) {
    const double h = 1e-5;
    Eigen::MatrixXd more = w;
    Eigen::MatrixXd less = w;
    more.data()[i] += h;
    less.data()[i] -= h;
    const double numeric = (evaluate(more).value - evaluate(less).value) / (2 * h);
    EXPECT_NEAR(gradient.data()[i], numeric, 1e-6 * gradient.norm());
  }
}

TEST(Penalties, GradientsAreThoseOfTheValues) {
  ExpectGradient([](const auto& w) { return EvaluateClusterPenalty(w, 0.3, 1.0); });
  ExpectGradient([](const auto& w) { return EvaluateStructurePenalty(w, 0.3, 1.0); });
}

TEST(StructurePenalty, IsTheTraceOfItsDefinition) {
  const Eigen::MatrixXd w = Random(8, 3, 8);
  const StructurePenalty penalty = EvaluateStructurePenalty(w, 0.2, 1.0);
  const Eigen::MatrixXd m = penalty.u * penalty.m.asDiagonal() * penalty.u.transpose();
  const Eigen::MatrixXd a = (m + 0.2 * Eigen::MatrixXd::Identity(8, 8)).inverse();
  EXPECT_NEAR(m.trace(), 1, 1e-9);
  EXPECT_NEAR(penalty.value, (w.transpose() * a * w).trace(), 1e-9 * penalty.value);
  EXPECT_LT((penalty.gradient - 2 * a * w).norm(), 1e-9 * penalty.gradient.norm());
}

// Both relaxations come to the same function of W's singular values.
TEST(Penalties, AgreeWithEachOther) {
  const Eigen::MatrixXd w = Random(25, 3, 9);
  for (const double budget : {0.5, 1.0, 2.0, 3.0}) {
    const double cluster = EvaluateClusterPenalty(w, 0.4, budget).value;
    EXPECT_NEAR(cluster, EvaluateStructurePenalty(w, 0.4, budget).value, 1e-9 * cluster);
  }
  // All of the budget: ridge.
  EXPECT_NEAR(EvaluateClusterPenalty(w, 0.4, 3).value, w.squaredNorm() / 1.4, 1e-9);
}

}  // namespace
}  // namespace viewfix
