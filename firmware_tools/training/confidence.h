// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "models/model_view.h"

namespace viewfix {

// A guess on held-out data: its margin, or what the confidence is a curve of instead, whether it
// was right, and what it counts for.
struct Outcome {
  double margin = 0;
  bool right = false;
  double weight = 1;
};

// Fits p(right | margin) = 1 / (1 + exp(-(offset + slope margin))), slope >= 0, by maximum
// likelihood with Platt's smoothed targets (Lin, Lin, Weng, Machine Learning 2007), and sets
// the threshold at one half: an answer is given where it is more likely right than wrong.
ModelConfidence FitConfidence(std::span<const Outcome> outcomes);

// Its value at a margin.
double ConfidenceOf(const ModelConfidence& confidence, double margin);

// Share of the outcomes whose confidence reaches the threshold, and what share of those is wrong,
// whatever their weights; 0 of none.
struct Answered {
  double share = 0;
  double wrong = 0;
};
Answered AnsweredOf(std::span<const Outcome> outcomes, const ModelConfidence& confidence);

// Mean of -log p(what was) over the outcomes, weighed, at a curve.
double LogLoss(std::span<const Outcome> outcomes, const ModelConfidence& confidence);

// Raises the curve's threshold, where need be, so far that of the outcomes answered no more than
// `wrong_share` are wrong, whatever their weights: the widest set of greatest margins for which
// that holds is answered. With a `chance` below 1 so many wrong ones are borne as would be there
// with that probability if the share of all such answers were `wrong_share`: few outcomes cannot
// tell half a per cent from one.
void LimitWrongAnswers(std::span<const Outcome> outcomes, double wrong_share,
                       ModelConfidence& confidence, double chance = 1);

}  // namespace viewfix
