// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "engine/base/exp.h"

namespace viewfix {

// exp(-r2 / (2 sigma^2)), not normalized.
constexpr float Gaussian(double r2, double sigma) {
  return static_cast<float>(Exp(-r2 / (2 * sigma * sigma)));
}

}  // namespace viewfix
