// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "firmware_tools/experiment/proximal_gradient.h"

namespace viewfix {

// The samples of the T tasks of a linear model f_t(x) = w_t'x + b_t. Tasks share samples: one that
// stands in each of them is read once for all.
struct LearningTasks {
  Eigen::MatrixXf samples;  // [D, N] one column each
  Eigen::MatrixXd labels;   // [N, T] +1 or -1; 0: not a sample of this task
};

// W and b of T tasks. The loss of all that follows is the logistic one, each task's mean:
//   L(W, b) = sum_t 1/n_t sum_i log(1 + exp(-y_it (w_t'x_i + b_t))),  b not regularized.
struct MultitaskWeights {
  Eigen::MatrixXd w;     // [D, T]
  Eigen::RowVectorXd b;  // [T]
  bool converged = false;
};

// L and its gradients (as large as w and b) at (w, b).
double LogisticLoss(const LearningTasks& tasks, const Eigen::MatrixXd& w,
                    const Eigen::RowVectorXd& b, Eigen::MatrixXd* w_gradient,
                    Eigen::RowVectorXd* b_gradient);

// min L(P + Q, b) + gamma |P|_1  s.t.  |Q|_* <= tau,  W = P + Q
// (Chen, Liu, Ye, ACM TKDD 2012). gamma >= 0, tau >= 0.
struct SparseTraceWeights : MultitaskWeights {
  Eigen::MatrixXd p;  // [D, T] sparse
  Eigen::MatrixXd q;  // [D, T] of bounded trace norm
};
SparseTraceWeights SolveSparseTrace(const LearningTasks& tasks, double gamma, double tau,
                                    const ProximalOptions& options);

// min L(W, b) + rho (1 + eta) Omega(W), Omega by EvaluateClusterPenalty() or
// EvaluateStructurePenalty(); rho is the papers' rho_1 eta: with M = I what is left is
// rho |W|^2. M is minimized exactly for each W, which leaves a smooth problem in W alone.
//   rho > 0, eta > 0, 0 < k <= T, 0 < h
MultitaskWeights SolveClustered(const LearningTasks& tasks, double rho, double eta, double k,
                                const ProximalOptions& options);
MultitaskWeights SolveStructure(const LearningTasks& tasks, double rho, double eta, double h,
                                const ProximalOptions& options);

}  // namespace viewfix
