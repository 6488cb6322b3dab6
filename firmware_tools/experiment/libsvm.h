// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "firmware_tools/experiment/method.h"

namespace viewfix {

// A two-class SVM as a sum over samples: f(x) = sum_i coefficient_i K(x_i, x) + bias.
struct BinarySvm {
  std::vector<std::pair<int, double>> terms;  // (row of the kernel, a_i y_i)
  double bias = 0;
};

// libsvm's C-SVC with a kernel given as a matrix:
//   min 1/2 w'w + C sum_i max(0, 1 - y_i (w'phi(x_i) + bias)).
//   kernel  [n, n]    samples  rows of it that are trained on    labels  [samples] +1 or -1
//   tolerance of the violation of optimality, libsvm's eps; its kernel is rounded to float
// Deterministic, thread-safe. Throws std::invalid_argument unless both labels occur, the sizes
// agree and c > 0.
BinarySvm TrainLibsvm(const Eigen::MatrixXf& kernel, std::span<const int> samples,
                      std::span<const int> labels, double c, double tolerance = 1e-3);

// One against the rest with libsvm's linear kernel, predicting as libsvm does: by a sum over
// support vectors, not by one dot product. There to be timed.
//   locations  [samples] 0..num_locations-1; each of them occurs
std::unique_ptr<Predictor> TrainLibsvmOneVsRest(std::span<const Histogram> histograms,
                                                std::span<const int> locations, int num_locations,
                                                double c);

}  // namespace viewfix
