// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/pose_confidence.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace viewfix {
namespace {

// Poses whose chance to be right follows the given weights.
std::vector<PoseOutcome> Draw(const ModelPoseConfidence& truth, int count) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> uniform;
  std::vector<PoseOutcome> outcomes(count);
  for (PoseOutcome& o : outcomes) {
    for (float& cue : o.cues) cue = 2 * uniform(random);
    o.right = uniform(random) < PoseConfidence(truth, o.cues);
  }
  return outcomes;
}

TEST(FitPoseConfidence, RecoversTheCurveThatMadeTheData) {
  const ModelPoseConfidence truth = {-3, {1, 2, 0.5F}, 0};
  const auto found = FitPoseConfidence(Draw(truth, 40000), {.wrong_share = 1});
  EXPECT_NEAR(found.offset, truth.offset, 0.15);
  for (int c = 0; c < kPoseCues; ++c) EXPECT_NEAR(found.weights[c], truth.weights[c], 0.1) << c;
  EXPECT_EQ(found.threshold, 0.5F);
}

TEST(FitPoseConfidence, ACueThatMisleadsIsNotUsed) {
  const auto found = FitPoseConfidence(Draw({1, {-2, 3, 0}, 0}, 20000), {});
  EXPECT_EQ(found.weights[0], 0);
  EXPECT_GT(found.weights[1], 1);
}

TEST(FitPoseConfidence, SeparableAndOneSidedOutcomesStayFinite) {
  std::vector<PoseOutcome> outcomes(40);
  for (int i = 0; i < 40; ++i) outcomes[i] = {{0.05F * static_cast<float>(i), 0.5F, 1}, i >= 20};
  for (int rounds = 0; rounds < 2; ++rounds) {
    const auto found = FitPoseConfidence(outcomes, {});
    EXPECT_TRUE(std::isfinite(found.offset));
    for (const float weight : found.weights) EXPECT_TRUE(std::isfinite(weight));
    EXPECT_GT(PoseConfidence(found, outcomes.back().cues), 0.8F);
    for (PoseOutcome& o : outcomes) o.right = true;
  }
}

// Of a site whose held-out frames lie near its photographs, all are right; poses of few landmarks,
// a small part of what should be seen, are not believed for it.
TEST(FitPoseConfidence, RightOutcomesAloneDoNotVouchForPoorPoses) {
  const std::vector<PoseOutcome> outcomes(80, {{1.5F, 0.8F, 1}, true});
  const auto found = FitPoseConfidence(outcomes, {});
  EXPECT_GT(PoseConfidence(found, {1.5F, 0.8F, 1}), 0.95F);
  EXPECT_GT(PoseConfidence(found, {0.6F, 0.3F, 1}), found.threshold);
  EXPECT_LT(PoseConfidence(found, {0.4F, 0.07F, 0.2F}), found.threshold);
}

// The threshold keeps its promise on the frames it was fitted on, those of hidden places aside.
TEST(FitPoseConfidence, TheThresholdLimitsWrongAnswers) {
  auto outcomes = Draw({-2, {1, 2, 0}, 0}, 4000);
  for (int i = 0; i < 500; ++i) outcomes.push_back({{1.8F, 1.8F, 1.8F}, false, true});
  const auto found =
      FitPoseConfidence(outcomes, {.hidden_weight = 0.01, .wrong_share = 0.05, .chance = 1});
  int answered = 0, wrong = 0;
  for (const PoseOutcome& o : outcomes) {
    if (o.of_hidden_place || PoseConfidence(found, o.cues) < found.threshold) continue;
    ++answered;
    wrong += o.right ? 0 : 1;
  }
  EXPECT_GT(found.threshold, 0.5F);
  EXPECT_GT(answered, 200);
  EXPECT_LE(wrong, 0.05 * answered);
}

TEST(FitPoseConfidence, FramesOfHiddenPlacesMakeItCautious) {
  const auto known = Draw({-2, {1, 2, 0.5F}, 0}, 4000);
  auto with_hidden = known;
  for (int i = 0; i < 2000; ++i) with_hidden.push_back({{0.5F, 0.5F, 0.5F}, false, true});
  const PoseCues cues = {0.5F, 0.5F, 0.5F};
  EXPECT_LT(PoseConfidence(FitPoseConfidence(with_hidden, {}), cues),
            PoseConfidence(FitPoseConfidence(known, {}), cues));
}

}  // namespace
}  // namespace viewfix
