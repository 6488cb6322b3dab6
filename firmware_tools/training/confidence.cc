// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/confidence.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace viewfix {
namespace {

struct Curve {
  double offset = 0;
  double slope = 0;
};

struct Targets {
  double right, wrong;
};

double Logistic(double x) { return 1.0 / (1.0 + std::exp(-x)); }

double Loss(std::span<const Outcome> outcomes, const Targets& targets, const Curve& curve) {
  double loss = 0;
  for (const Outcome& o : outcomes) {
    const double z = curve.offset + curve.slope * o.margin;
    const double target = o.right ? targets.right : targets.wrong;
    loss += o.weight * (std::max(z, 0.0) - target * z + std::log1p(std::exp(-std::abs(z))));
  }
  return loss;
}

// Newton's step on the loss; the small diagonal keeps it defined where all margins agree.
Curve NewtonStep(std::span<const Outcome> outcomes, const Targets& targets, const Curve& curve) {
  double g0 = 0, g1 = 0, h00 = 1e-9, h01 = 0, h11 = 1e-9;
  for (const Outcome& o : outcomes) {
    const double p = Logistic(curve.offset + curve.slope * o.margin);
    const double error = o.weight * (p - (o.right ? targets.right : targets.wrong));
    const double weight = o.weight * p * (1 - p);
    g0 += error;
    g1 += error * o.margin;
    h00 += weight;
    h01 += weight * o.margin;
    h11 += weight * o.margin * o.margin;
  }
  const double det = h00 * h11 - h01 * h01;
  return {-(h11 * g0 - h01 * g1) / det, -(h00 * g1 - h01 * g0) / det};
}

// The largest k for which k or more of n are wrong with a probability of at least `chance`, each
// being wrong with probability `share`.
int MostByChance(int n, double share, double chance) {
  if (chance >= 1 || share <= 0) return 0;
  if (share >= 1) return n;
  double log_exactly = n * std::log1p(-share);  // k are wrong; its logarithm, as it may be tiny
  double more = 1 - std::exp(log_exactly);
  int k = 0;
  while (k < n && more >= chance) {
    ++k;
    log_exactly += std::log(share / (1 - share) * (n - k + 1) / k);
    more -= std::exp(log_exactly);
  }
  return k;
}

}  // namespace

ModelConfidence FitConfidence(std::span<const Outcome> outcomes) {
  double right = 0, wrong = 0;
  for (const Outcome& o : outcomes) (o.right ? right : wrong) += o.weight;
  const Targets targets = {(right + 1) / (right + 2), 1 / (wrong + 2)};
  Curve curve = {std::log((right + 1) / (wrong + 1)), 0};
  double loss = Loss(outcomes, targets, curve);
  for (int iteration = 0; iteration < 100; ++iteration) {
    const Curve step = NewtonStep(outcomes, targets, curve);
    double length = 1;
    Curve next = curve;
    double next_loss = loss;
    for (; length > 1e-10; length /= 2) {
      next = {curve.offset + length * step.offset, curve.slope + length * step.slope};
      next_loss = Loss(outcomes, targets, next);
      if (next_loss <= loss) break;
    }
    const bool settled = loss - next_loss < 1e-10 * std::max(1.0, loss);
    if (next_loss <= loss) {
      curve = next;
      loss = next_loss;
    }
    if (settled) break;
  }
  if (curve.slope < 0) curve = {std::log((right + 1) / (wrong + 1)), 0};
  return {static_cast<float>(curve.offset), static_cast<float>(curve.slope), 0.5F};
}

double ConfidenceOf(const ModelConfidence& confidence, double margin) {
  return Logistic(double{confidence.offset} + double{confidence.slope} * margin);
}

Answered AnsweredOf(std::span<const Outcome> outcomes, const ModelConfidence& confidence) {
  double answered = 0, wrong = 0;
  for (const Outcome& o : outcomes) {
    if (!(ConfidenceOf(confidence, o.margin) >= double{confidence.threshold})) continue;
    answered += 1;
    wrong += o.right ? 0 : 1;
  }
  if (answered == 0) return {};
  return {answered / static_cast<double>(outcomes.size()), wrong / answered};
}

double LogLoss(std::span<const Outcome> outcomes, const ModelConfidence& confidence) {
  const Curve curve = {confidence.offset, confidence.slope};
  double weight = 0;
  for (const Outcome& o : outcomes) weight += o.weight;
  return Loss(outcomes, {1, 0}, curve) / weight;
}

void LimitWrongAnswers(std::span<const Outcome> outcomes, double wrong_share,
                       ModelConfidence& confidence, double chance) {
  std::vector<Outcome> sorted(outcomes.begin(), outcomes.end());
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const Outcome& a, const Outcome& b) { return a.margin > b.margin; });
  std::size_t answered = 0;
  double wrong = 0;
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    wrong += sorted[i].right ? 0 : 1;
    const auto size = static_cast<int>(i + 1);
    if (wrong <= wrong_share * size || wrong <= MostByChance(size, wrong_share, chance)) {
      answered = i + 1;
    }
  }
  // The first that is not answered is wrong, or the set would be wider.
  if (answered == sorted.size() || confidence.slope == 0) return;
  const double least = ConfidenceOf(confidence, sorted[answered].margin);
  const float above = std::nextafter(static_cast<float>(least), 1.0F);
  confidence.threshold = std::max(confidence.threshold, above);
}

}  // namespace viewfix
