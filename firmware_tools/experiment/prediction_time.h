// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "firmware_tools/evaluation/metrics.h"
#include "firmware_tools/experiment/method.h"

namespace viewfix {

// What a prediction takes, and how many times what the first predictor takes.
struct PredictionTime {
  double ms = 0;  // median of the rounds
  Interval ms_ci95;
  double times_first = 0;
  Interval times_first_ci95;
};

// Processor time of one of `histograms` for each predictor, on one thread, over rounds in each of
// which every predictor has its turn: what else the machine does is unfair to none.
std::vector<PredictionTime> MeasurePredictionTimes(
    const std::vector<std::unique_ptr<Predictor>>& predictors,
    std::span<const Histogram> histograms);

// Medians with their 95 % bootstrap intervals: rounds are drawn with replacement (2000 times,
// seeded), the same ones for both, since what slows a round slows its neighbours.
//   ms, first_ms   [rounds] milliseconds a prediction, > 0; at least one
PredictionTime SummarizeRounds(std::span<const double> ms, std::span<const double> first_ms);

}  // namespace viewfix
