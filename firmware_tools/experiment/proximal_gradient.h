// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <functional>

namespace viewfix {

// min_x  smooth(x) + regularizer(x), both convex, the regularizer known by its proximal operator.
struct ProximalProblem {
  // Value at x; its gradient, as large as x, where asked for.
  std::function<double(const Eigen::MatrixXd& x, Eigen::MatrixXd* gradient)> smooth;
  // Replaces x by argmin_z 1/2 |z - x|^2 + step * regularizer(z). Empty: no regularizer.
  std::function<void(double step, Eigen::MatrixXd& x)> prox;
};

struct ProximalOptions {
  int max_iterations = 20000;  // >= 1
  // It ends when the gradient mapping |x - prox(x - gradient / L)| * L (Frobenius) is below this.
  double tolerance = 1e-7;
  double first_curvature = 0.1;  // > 0; L, doubled until it bounds the smooth part
};

struct ProximalResult {
  Eigen::MatrixXd x;
  int iterations = 0;
  bool converged = false;
};

// Accelerated proximal gradient with backtracking (Beck, Teboulle, SIAM J. Imaging Sciences 2009),
// started anew where its momentum points uphill (O'Donoghue, Candes, Found. Comput. Math. 2015).
// Deterministic.
ProximalResult MinimizeProximal(const ProximalProblem& problem, const Eigen::MatrixXd& start,
                                const ProximalOptions& options);

}  // namespace viewfix
