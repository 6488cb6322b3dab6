// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <vector>

namespace viewfix {

// How sure an answer was, and whether it was right.
struct Judgement {
  double confidence = 0;  // 0..1
  bool right = false;
};

struct Interval {
  double low = 0;
  double high = 0;
};

// Quantile q of the values (linear interpolation between order statistics); no value: none.
std::optional<double> Quantile(std::vector<double> values, double q);

// Wilson's 95 % interval of a share.
Interval WilsonInterval(int hits, int trials);

// Expected calibration error: mean |share right - mean confidence| over `bins` bins that
// hold equally many judgements each.
double ExpectedCalibrationError(std::vector<Judgement> judgements, int bins = 10);

// Its 95 % bootstrap interval over 1000 resamples, seeded.
Interval BootstrapCalibrationError(std::span<const Judgement> judgements, int bins = 10);

// Mean squared difference between confidence and outcome.
double BrierScore(std::span<const Judgement> judgements);

// The Brier score of a predictor that always says the share right.
double ConstantBrierScore(std::span<const Judgement> judgements);

// Probability that a right answer is surer than a wrong one (ties count half); none where
// all are right or all wrong.
std::optional<double> AreaUnderRoc(std::vector<Judgement> judgements);

// Share wrong among the surest `coverage` of the answers.
double RiskAtCoverage(std::vector<Judgement> judgements, double coverage);

}  // namespace viewfix
