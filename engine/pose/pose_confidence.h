// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/base/exp.h"
#include "models/model_view.h"

namespace viewfix {

// What speaks for a pose, each about 0..1: how many landmarks agree, what share that is of all that
// should be seen, weighed by their rarity, and over how much of the image they are spread. What
// speaks for another pose is judged apart (ambiguous).
using PoseCues = std::array<float, kPoseCues>;

// Of FoundPose's numbers (pose_finder.h).
inline PoseCues PoseCuesOf(int num_inliers, float evidence, float expected, float spread) {
  return {std::sqrt(static_cast<float>(num_inliers)) / 10,
          expected > 0 ? std::min(1.0F, evidence / expected) : 1.0F, spread};
}

// p = 1 / (1 + exp(-(offset + weights . cues))), the probability that the pose is right as frames
// held out of the training say.
inline float PoseConfidence(const ModelPoseConfidence& curve, const PoseCues& cues) {
  double sum = double{curve.offset};
  for (int c = 0; c < kPoseCues; ++c) sum += double{curve.weights[c]} * double{cues[c]};
  return static_cast<float>(1.0 / (1.0 + Exp(-sum)));
}

}  // namespace viewfix
