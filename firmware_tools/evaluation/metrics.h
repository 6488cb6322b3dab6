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

// One of those bins.
struct ReliabilityBin {
  double confidence = 0;  // mean
  double right = 0;       // share
  int hits = 0;           // right ones
  int count = 0;
};

// The bins that hold a judgement, in ascending confidence.
std::vector<ReliabilityBin> ReliabilityDiagram(std::vector<Judgement> judgements, int bins = 10);

// Its 95 % bootstrap interval over 1000 resamples, seeded.
Interval BootstrapCalibrationError(std::span<const Judgement> judgements, int bins = 10);

// Mean squared difference between confidence and outcome.
double BrierScore(std::span<const Judgement> judgements);

// The Brier score of a predictor that always says the share right.
double ConstantBrierScore(std::span<const Judgement> judgements);

// Probability that a right answer is surer than a wrong one (ties count half); none where
// all are right or all wrong.
std::optional<double> AreaUnderRoc(std::vector<Judgement> judgements);

// If only answers of at least `confidence` were given: their share of all, and the share of them
// that is wrong.
struct RiskCoverage {
  double coverage = 0;
  double risk = 0;
  double confidence = 0;
};

// From the surest answers to all of them: one point for each confidence that occurs, for equal ones
// are given together or not at all; no more than `max_points`, spread evenly, the last among them.
std::vector<RiskCoverage> RiskCoverageCurve(std::vector<Judgement> judgements,
                                            int max_points = 200);

// Share wrong among the surest `coverage` of the answers.
double RiskAtCoverage(std::vector<Judgement> judgements, double coverage);

}  // namespace viewfix
