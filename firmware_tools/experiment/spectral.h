// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace viewfix {

// argmin_z 1/2 |z - x|^2 + threshold * |z|_1, in place.
void SoftThreshold(double threshold, Eigen::Ref<Eigen::MatrixXd> x);

// Euclidean projection of a vector of numbers >= 0 onto {z >= 0, sum z <= radius}, radius >= 0.
Eigen::VectorXd ProjectToSimplex(const Eigen::VectorXd& x, double radius);

// Euclidean projection of a matrix onto {|Z|_* <= radius}: that of its singular values.
Eigen::MatrixXd ProjectToTraceBall(const Eigen::MatrixXd& x, double radius);

// Sum of singular values.
double TraceNorm(const Eigen::MatrixXd& x);

// argmin_m sum_i s_i^2 / (eta + m_i)  s.t.  0 <= m_i <= 1, sum m = budget:
// m_i = clamp(s_i / nu - eta, 0, 1) for the one nu that spends the budget.
//   s [n] >= 0; eta > 0; 0 < budget <= n. What more than the positive s_i could take goes to the
//   others in equal parts.
Eigen::VectorXd SpendBudget(const Eigen::VectorXd& s, double eta, double budget);

// Omega(W) = min_M tr(W (eta I + M)^-1 W')  s.t.  0 <= M <= I, tr M = k, M [T, T]: the penalty of
// clustered multi-task learning, relaxed (Zhou, Chen, Ye, NIPS 2011). Convex in W, and smooth: M
// shares eigenvectors with W'W, its eigenvalues are SpendBudget() of W's singular values.
struct ClusterPenalty {
  double value = 0;
  Eigen::MatrixXd gradient;  // [D, T] 2 W (eta I + M)^-1
  Eigen::MatrixXd m;         // [T, T]
};
ClusterPenalty EvaluateClusterPenalty(const Eigen::MatrixXd& w, double eta, double k);

// Omega(W) = min_M tr(W' (eta I + M)^-1 W)  s.t.  0 <= M <= I, tr M = h, M [D, D]: the penalty of
// convex alternating structure optimization (Chen, Tang, Liu, Ye, ICML 2009). M is
// sum_i m_i u_i u_i' over W's left singular vectors (and any others where h exceeds its rank).
struct StructurePenalty {
  double value = 0;
  Eigen::MatrixXd gradient;  // [D, T] 2 (eta I + M)^-1 W
  Eigen::MatrixXd u;         // [D, min(D, T)] left singular vectors
  Eigen::VectorXd m;         // [min(D, T)] eigenvalues of M along them
};
StructurePenalty EvaluateStructurePenalty(const Eigen::MatrixXd& w, double eta, double h);

}  // namespace viewfix
