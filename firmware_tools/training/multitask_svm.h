// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

namespace viewfix {

// One dual variable a_i of eq. (3) in method.md: a sample taking part in one task.
struct DualVariable {
  int sample_idx = 0;  // row of the kernel matrices
  int task = 0;        // 0..num_tasks-1
  int label = 1;       // y: +1 or -1
  double cost = 1;     // C for this variable: 0 <= a_i <= cost
};

struct MultitaskSvmOptions {
  double beta = 1;  // > 0; large: tasks share one direction, small: tasks stand alone
  // Stop when (primal - dual) <= relative_gap * |dual|. Measured against the dual itself, since
  // a small C makes all of it small: an absolute bound would accept a = 0.
  double relative_gap = 1e-6;
  std::int64_t max_iterations = 50'000'000;
};

struct MultitaskSvmSolution {
  std::vector<double> alpha;  // [variables], same order
  std::vector<double> bias;   // [tasks] b + d_t; NaN: the task lacks positives or negatives
  double primal = 0;          // eq. (2)
  double dual = 0;            // eq. (3)
  std::int64_t iterations = 0;
  bool converged = false;  // the gap was reached within max_iterations
};

// Solves eq. (3) of method.md by generalized SMO: one equality constraint a task, so each
// step moves a pair of variables of one task (Cai & Cherkassky, IEEE TNNLS 2012; second-order
// working set selection of Fan, Chen, Lin, JMLR 2005, inside each task). Each bias minimizes
// the primal given the scores, so that primal - dual is a certificate.
//   decision_kernel   [n, n] K(x_i, x_j), symmetric positive semidefinite, shared by all calls
//   correcting_kernel [n, n] K_t(x_i, x_j); pass the same matrix when the spaces agree
// Variables of a task without positives or without negatives are left at 0. Deterministic.
// Thread-safe: only reads its arguments.
// Throws std::invalid_argument for kernels that are not square, of unequal size or not finite,
// indices out of range, a label other than +-1, a cost outside (0, 1e100], beta outside
// [1e-100, 1e100].
MultitaskSvmSolution SolveMultitaskSvm(const Eigen::Ref<const Eigen::MatrixXf>& decision_kernel,
                                       const Eigen::Ref<const Eigen::MatrixXf>& correcting_kernel,
                                       std::span<const DualVariable> variables, int num_tasks,
                                       const MultitaskSvmOptions& options);

}  // namespace viewfix
