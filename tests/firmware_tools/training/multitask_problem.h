// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <random>
#include <vector>

#include "firmware_tools/training/multitask_svm.h"

namespace viewfix::testing {

using RowMajorMatrixXf = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Random samples [n, D] and the part each takes in some tasks.
struct MultitaskProblem {
  RowMajorMatrixXf features;
  std::vector<DualVariable> variables;
  int num_tasks = 1;
};

// Uniform in [-1, 1]; the same on every platform.
inline double Symmetric(std::mt19937_64& random) {
  return static_cast<double>(random() >> 11) * 0x1.0p-52 - 1;
}

inline Eigen::MatrixXf Gram(const RowMajorMatrixXf& features) {
  const Eigen::MatrixXf gram = features * features.transpose();
  return gram.selfadjointView<Eigen::Lower>();
}

inline Eigen::MatrixXf GaussianGram(const RowMajorMatrixXf& features, float gamma) {
  Eigen::MatrixXf gram(features.rows(), features.rows());
  for (Eigen::Index i = 0; i < gram.rows(); ++i) {
    for (Eigen::Index j = 0; j < gram.cols(); ++j) {
      gram(i, j) = std::exp(-gamma * (features.row(i) - features.row(j)).squaredNorm());
    }
  }
  return gram;
}

// Two overlapping classes; positives of a task lie in a direction of its own. Each positive
// is in one task, each negative in all of them.
inline MultitaskProblem MakeProblem(int num_samples, int dim, int num_tasks, double cost,
                                    std::uint64_t seed) {
  std::mt19937_64 random(seed);
  MultitaskProblem problem;
  problem.num_tasks = num_tasks;
  problem.features.resize(num_samples, dim);
  for (int i = 0; i < num_samples; ++i) {
    const bool positive = i % 3 == 0;
    const int task = i / 3 % num_tasks;
    for (int d = 0; d < dim; ++d) {
      const double shift = positive ? 0.4 + (d == task ? 0.6 : 0.0) : 0.0;
      problem.features(i, d) = static_cast<float>(Symmetric(random) + shift);
    }
    if (positive) problem.variables.push_back({i, task, 1, cost});
    for (int t = 0; t < num_tasks && !positive; ++t) {
      problem.variables.push_back({i, t, -1, cost / num_tasks});
    }
  }
  return problem;
}

// f_t(x_s) of eq. (1) for each variable, bias included, straight from eq. (4).
inline std::vector<double> Decisions(const Eigen::MatrixXf& decision_kernel,
                                     const Eigen::MatrixXf& correcting_kernel,
                                     const std::vector<DualVariable>& variables, double beta,
                                     const MultitaskSvmSolution& solution) {
  std::vector<double> decisions;
  for (const DualVariable& at : variables) {
    double sum = solution.bias[at.task];
    for (std::size_t i = 0; i < variables.size(); ++i) {
      const DualVariable& v = variables[i];
      double kernel = decision_kernel(v.sample_idx, at.sample_idx);
      if (v.task == at.task) kernel += correcting_kernel(v.sample_idx, at.sample_idx) / beta;
      sum += solution.alpha[i] * v.label * kernel;
    }
    decisions.push_back(sum);
  }
  return decisions;
}

}  // namespace viewfix::testing
