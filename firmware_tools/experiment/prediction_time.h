// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "firmware_tools/experiment/method.h"

namespace viewfix {

// Milliseconds that each predictor takes for one of `histograms`, on one thread: the shortest of
// several rounds, in each of which every predictor has its turn, so that a busy machine is
// unfair to none.
std::vector<double> MeasurePredictionTimes(
    const std::vector<std::unique_ptr<Predictor>>& predictors,
    std::span<const Histogram> histograms);

}  // namespace viewfix
