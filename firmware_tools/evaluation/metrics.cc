// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/evaluation/metrics.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

namespace viewfix {
namespace {

void SortByConfidence(std::vector<Judgement>& judgements) {
  std::stable_sort(judgements.begin(), judgements.end(),
                   [](const auto& a, const auto& b) { return a.confidence < b.confidence; });
}

double ShareRight(std::span<const Judgement> judgements) {
  const auto right = std::count_if(judgements.begin(), judgements.end(),
                                   [](const Judgement& j) { return j.right; });
  return static_cast<double>(right) / static_cast<double>(judgements.size());
}

}  // namespace

std::optional<double> Quantile(std::vector<double> values, double q) {
  if (values.empty()) return std::nullopt;
  std::sort(values.begin(), values.end());
  const double position = q * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(position);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  const double share = position - static_cast<double>(below);
  if (share == 0.0) return values[below];  // an infinite neighbour must not count
  return values[below] * (1 - share) + values[above] * share;
}

Interval WilsonInterval(int hits, int trials) {
  if (trials == 0) return {0, 1};
  constexpr double z = 1.959963984540054;
  const double n = trials;
  const double p = hits / n;
  const double centre = (p + z * z / (2 * n)) / (1 + z * z / n);
  const double half = z / (1 + z * z / n) * std::sqrt(p * (1 - p) / n + z * z / (4 * n * n));
  return {std::max(0.0, centre - half), std::min(1.0, centre + half)};
}

std::vector<ReliabilityBin> ReliabilityDiagram(std::vector<Judgement> judgements, int bins) {
  SortByConfidence(judgements);
  const std::size_t n = judgements.size();
  std::vector<ReliabilityBin> diagram;
  for (int b = 0; b < bins; ++b) {
    const std::size_t begin = n * b / bins;
    const std::size_t end = n * (b + 1) / bins;
    if (begin == end) continue;
    ReliabilityBin bin;
    for (std::size_t i = begin; i < end; ++i) {
      bin.confidence += judgements[i].confidence;
      bin.hits += judgements[i].right ? 1 : 0;
    }
    bin.count = static_cast<int>(end - begin);
    bin.confidence /= bin.count;
    bin.right = static_cast<double>(bin.hits) / bin.count;
    diagram.push_back(bin);
  }
  return diagram;
}

double ExpectedCalibrationError(std::vector<Judgement> judgements, int bins) {
  const auto n = static_cast<double>(judgements.size());
  double error = 0;
  for (const ReliabilityBin& bin : ReliabilityDiagram(std::move(judgements), bins)) {
    error += bin.count * std::abs(bin.right - bin.confidence);
  }
  return n == 0 ? 0 : error / n;
}

Interval BootstrapCalibrationError(std::span<const Judgement> judgements, int bins) {
  constexpr int kResamples = 1000;
  std::mt19937_64 random(1);
  std::vector<double> errors;
  std::vector<Judgement> sample(judgements.size());
  for (int r = 0; r < kResamples && !judgements.empty(); ++r) {
    for (Judgement& j : sample) j = judgements[random() % judgements.size()];
    errors.push_back(ExpectedCalibrationError(sample, bins));
  }
  return {Quantile(errors, 0.025).value_or(0), Quantile(errors, 0.975).value_or(0)};
}

double BrierScore(std::span<const Judgement> judgements) {
  double sum = 0;
  for (const Judgement& j : judgements) {
    const double error = j.confidence - (j.right ? 1.0 : 0.0);
    sum += error * error;
  }
  return judgements.empty() ? 0 : sum / static_cast<double>(judgements.size());
}

double ConstantBrierScore(std::span<const Judgement> judgements) {
  if (judgements.empty()) return 0;
  const double p = ShareRight(judgements);
  return p * (1 - p);
}

std::optional<double> AreaUnderRoc(std::vector<Judgement> judgements) {
  SortByConfidence(judgements);
  double rank_sum = 0;  // of the right ones, ties sharing their mean rank
  double right = 0;
  for (std::size_t begin = 0; begin < judgements.size();) {
    std::size_t end = begin;
    double right_here = 0;
    while (end < judgements.size() && judgements[end].confidence == judgements[begin].confidence) {
      right_here += judgements[end++].right ? 1 : 0;
    }
    rank_sum += right_here * (static_cast<double>(begin + end + 1) / 2);
    right += right_here;
    begin = end;
  }
  const double wrong = static_cast<double>(judgements.size()) - right;
  if (right == 0 || wrong == 0) return std::nullopt;
  return (rank_sum - right * (right + 1) / 2) / (right * wrong);
}

std::vector<RiskCoverage> RiskCoverageCurve(std::vector<Judgement> judgements, int max_points) {
  SortByConfidence(judgements);
  const auto n = static_cast<double>(judgements.size());
  std::vector<RiskCoverage> all;
  int given = 0;
  int wrong = 0;
  for (auto j = judgements.rbegin(); j != judgements.rend(); ++j) {
    ++given;
    wrong += j->right ? 0 : 1;
    const auto next = j + 1;
    if (next != judgements.rend() && next->confidence == j->confidence) continue;
    all.push_back({given / n, static_cast<double>(wrong) / given, j->confidence});
  }
  const std::size_t points = std::min<std::size_t>(all.size(), max_points);
  std::vector<RiskCoverage> curve;
  for (std::size_t i = 1; i <= points; ++i) curve.push_back(all[all.size() * i / points - 1]);
  return curve;
}

double RiskAtCoverage(std::vector<Judgement> judgements, double coverage) {
  if (judgements.empty()) return 0;
  SortByConfidence(judgements);
  const auto kept = std::max<std::size_t>(
      1, static_cast<std::size_t>(std::ceil(coverage * static_cast<double>(judgements.size()))));
  return 1 - ShareRight(std::span(judgements).last(kept));
}

}  // namespace viewfix
