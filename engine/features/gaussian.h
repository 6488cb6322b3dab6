// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace viewfix {

// exp(-t) for t in 0..20, by its series about t / 32 (relative error below 1e-9):
// plain arithmetic, so that tables made with it have the same bits everywhere.
constexpr double ExpNegative(double t) {
  const double u = t / 32;
  double term = 1;
  double sum = 1;
  for (int n = 1; n < 14; ++n) {
    term *= u / n;
    sum += term;
  }
  for (int i = 0; i < 5; ++i) sum *= sum;
  return 1 / sum;
}

// exp(-r2 / (2 sigma^2)), not normalized.
constexpr float Gaussian(double r2, double sigma) {
  return static_cast<float>(ExpNegative(r2 / (2 * sigma * sigma)));
}

}  // namespace viewfix
