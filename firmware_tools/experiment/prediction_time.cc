// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/experiment/prediction_time.h"

#include <ctime>
#include <random>

namespace viewfix {
namespace {

constexpr int kRounds = 31;
constexpr double kMinRoundMs = 2;
constexpr int kResamples = 2000;

// Processor time of this thread: on a busy machine the time of day counts others' work too.
double ThreadMs() {
  timespec now = {};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

// Milliseconds a prediction, over whole passes that take kMinRoundMs at least.
double TimeOnce(const Predictor& predictor, std::span<const Histogram> histograms) {
  volatile int sink = 0;  // keeps answers from being dropped
  const double start = ThreadMs();
  double elapsed = 0;
  int predictions = 0;
  while (elapsed < kMinRoundMs) {
    for (const Histogram& h : histograms) sink = predictor.Predict(h).location;
    predictions += static_cast<int>(histograms.size());
    elapsed = ThreadMs() - start;
  }
  static_cast<void>(sink);
  return elapsed / predictions;
}

double Median(std::vector<double> values) { return *Quantile(std::move(values), 0.5); }

Interval Middle95(const std::vector<double>& values) {
  return {*Quantile(values, 0.025), *Quantile(values, 0.975)};
}

}  // namespace

PredictionTime SummarizeRounds(std::span<const double> ms, std::span<const double> first_ms) {
  PredictionTime time;
  time.ms = Median({ms.begin(), ms.end()});
  time.times_first = time.ms / Median({first_ms.begin(), first_ms.end()});
  std::mt19937_64 random(1);
  std::vector<double> medians;
  std::vector<double> ratios;
  for (int r = 0; r < kResamples; ++r) {
    std::vector<double> drawn;
    std::vector<double> first_drawn;
    for (std::size_t i = 0; i < ms.size(); ++i) {
      const std::size_t round = random() % ms.size();
      drawn.push_back(ms[round]);
      first_drawn.push_back(first_ms[round]);
    }
    medians.push_back(Median(std::move(drawn)));
    ratios.push_back(medians.back() / Median(std::move(first_drawn)));
  }
  time.ms_ci95 = Middle95(medians);
  time.times_first_ci95 = Middle95(ratios);
  return time;
}

std::vector<PredictionTime> MeasurePredictionTimes(
    const std::vector<std::unique_ptr<Predictor>>& predictors,
    std::span<const Histogram> histograms) {
  std::vector<PredictionTime> times(predictors.size());
  if (histograms.empty()) return times;
  std::vector<std::vector<double>> ms(predictors.size());
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t p = 0; p < predictors.size(); ++p) {
      ms[p].push_back(TimeOnce(*predictors[p], histograms));
    }
  }
  for (std::size_t p = 0; p < times.size(); ++p) times[p] = SummarizeRounds(ms[p], ms.front());
  return times;
}

}  // namespace viewfix
