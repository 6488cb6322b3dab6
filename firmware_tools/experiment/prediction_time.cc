// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/experiment/prediction_time.h"

#include <algorithm>
#include <chrono>
#include <limits>

namespace viewfix {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kRounds = 15;
constexpr double kMinRoundMs = 2;

double MsSince(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

// Milliseconds a prediction, over whole passes that take kMinRoundMs at least.
double TimeOnce(const Predictor& predictor, std::span<const Histogram> histograms) {
  volatile int sink = 0;  // keeps answers from being dropped
  const Clock::time_point start = Clock::now();
  double elapsed = 0;
  int predictions = 0;
  while (elapsed < kMinRoundMs) {
    for (const Histogram& h : histograms) sink = predictor.Predict(h).location;
    predictions += static_cast<int>(histograms.size());
    elapsed = MsSince(start);
  }
  static_cast<void>(sink);
  return elapsed / predictions;
}

}  // namespace

std::vector<double> MeasurePredictionTimes(
    const std::vector<std::unique_ptr<Predictor>>& predictors,
    std::span<const Histogram> histograms) {
  std::vector<double> best(predictors.size(), std::numeric_limits<double>::infinity());
  if (histograms.empty()) return std::vector<double>(predictors.size(), 0.0);
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t p = 0; p < predictors.size(); ++p) {
      best[p] = std::min(best[p], TimeOnce(*predictors[p], histograms));
    }
  }
  return best;
}

}  // namespace viewfix
