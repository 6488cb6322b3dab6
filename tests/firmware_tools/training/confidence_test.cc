// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/confidence.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace viewfix {
namespace {

std::vector<Outcome> Draw(double offset, double slope, int count) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform;
  std::vector<Outcome> outcomes;
  for (int i = 0; i < count; ++i) {
    const double margin = 2 * uniform(random);
    const double p = 1 / (1 + std::exp(-(offset + slope * margin)));
    outcomes.push_back({margin, uniform(random) < p});
  }
  return outcomes;
}

TEST(FitConfidence, RecoversTheCurveThatMadeTheData) {
  const ModelConfidence curve = FitConfidence(Draw(-1, 3, 50000));
  EXPECT_NEAR(curve.offset, -1, 0.1);
  EXPECT_NEAR(curve.slope, 3, 0.15);
}

TEST(FitConfidence, AnOutcomeOfWeightTwoIsTwo) {
  std::vector<Outcome> heavy = Draw(-1, 3, 100), twice = heavy;
  for (int i = 0; i < 100; i += 3) {
    heavy[i].weight = 2;
    twice.push_back(twice[i]);
  }
  const ModelConfidence curve = FitConfidence(heavy), same = FitConfidence(twice);
  EXPECT_NEAR(curve.offset, same.offset, 1e-5);
  EXPECT_NEAR(curve.slope, same.slope, 1e-5);
  EXPECT_NEAR(LogLoss(heavy, curve), LogLoss(twice, curve), 1e-9);
  EXPECT_GT(std::abs(curve.slope - FitConfidence(Draw(-1, 3, 100)).slope), 1e-3);
}

TEST(FitConfidence, SeparableOutcomesStayFinite) {
  std::vector<Outcome> outcomes;
  for (int i = 0; i < 20; ++i) outcomes.push_back({0.1 * i, i >= 10});
  const ModelConfidence curve = FitConfidence(outcomes);
  EXPECT_TRUE(std::isfinite(curve.slope));
  EXPECT_GT(curve.slope, 0);
}

TEST(FitConfidence, AMarginThatMisleadsIsNotUsed) {
  const ModelConfidence curve = FitConfidence(Draw(1, -2, 2000));
  EXPECT_EQ(curve.slope, 0);
}

TEST(FitConfidence, DegenerateInputs) {
  EXPECT_TRUE(std::isfinite(FitConfidence({}).offset));
  const std::vector<Outcome> same(10, Outcome{0.5, true});
  const ModelConfidence curve = FitConfidence(same);
  EXPECT_TRUE(std::isfinite(curve.offset));
  EXPECT_TRUE(std::isfinite(curve.slope));
}

double ShareWrongOf(const std::vector<Outcome>& outcomes, const ModelConfidence& curve) {
  int answered = 0, wrong = 0;
  for (const Outcome& o : outcomes) {
    const double confidence = 1 / (1 + std::exp(-(curve.offset + curve.slope * o.margin)));
    if (confidence < curve.threshold) continue;
    ++answered;
    wrong += o.right ? 0 : 1;
  }
  return answered == 0 ? 0 : static_cast<double>(wrong) / answered;
}

TEST(LogLoss, IsLeastAtTheFittedCurve) {
  const std::vector<Outcome> outcomes = {
      {0.5, false}, {1, true}, {2, true}, {1.5, false}, {3, true}};
  const ModelConfidence certain = {.offset = 0, .slope = 0, .threshold = 0.5F};
  EXPECT_NEAR(LogLoss(outcomes, certain), std::log(2.0), 1e-6);
  ModelConfidence fitted = FitConfidence(outcomes);
  EXPECT_LT(LogLoss(outcomes, fitted), std::log(2.0));
  const double least = LogLoss(outcomes, fitted);
  fitted.slope = -fitted.slope;
  EXPECT_GT(LogLoss(outcomes, fitted), least);
}

TEST(LimitWrongAnswers, KeepsTheShareOfTheOutcomes) {
  const std::vector<Outcome> outcomes = Draw(-1, 3, 5000);
  for (const double share : {0.0, 0.01, 0.05}) {
    ModelConfidence curve = FitConfidence(outcomes);
    LimitWrongAnswers(outcomes, share, curve);
    EXPECT_LE(ShareWrongOf(outcomes, curve), share);
  }
}

// Of 120 answers 0.5 % are wrong. Two or more then are in 12 of 100 such sets, three or more in 2.
TEST(LimitWrongAnswers, BearsWhatChanceExplains) {
  for (const int wrong : {1, 2, 3}) {
    std::vector<Outcome> outcomes;
    for (int i = 0; i < 120; ++i) {
      // At the least margins, where a higher threshold withholds them.
      outcomes.push_back({1 - 0.005 * i, i < 120 - wrong});
    }
    ModelConfidence curve = {0, 1, 0.5F};
    LimitWrongAnswers(outcomes, 0.005, curve, 0.05);
    EXPECT_EQ(curve.threshold > 0.5F, wrong > 2) << wrong;
    ModelConfidence strict = {0, 1, 0.5F};
    LimitWrongAnswers(outcomes, 0.005, strict);
    EXPECT_GT(strict.threshold, 0.5F) << wrong;
    ModelConfidence none = {0, 1, 0.5F};
    LimitWrongAnswers(outcomes, 0, none, 0.05);
    EXPECT_EQ(ShareWrongOf(outcomes, none), 0) << wrong;
  }
}

// Of many answers little more than the share: 5 % of 40,000 are 2000, with a deviation of 44.
TEST(LimitWrongAnswers, ChanceExplainsLittleOfMany) {
  for (const int wrong : {2060, 2090}) {
    std::vector<Outcome> outcomes;
    for (int i = 0; i < 40000; ++i) outcomes.push_back({1 - 1e-5 * i, i < 40000 - wrong});
    ModelConfidence curve = {0, 1, 0.5F};
    LimitWrongAnswers(outcomes, 0.05, curve, 0.05);
    EXPECT_EQ(curve.threshold > 0.5F, wrong == 2090) << wrong;
  }
}

TEST(LimitWrongAnswers, WhereNoneAreWrongTheThresholdStays) {
  const std::vector<Outcome> right(10, Outcome{0.5, true});
  ModelConfidence curve = FitConfidence(right);
  LimitWrongAnswers(right, 0.005, curve);
  EXPECT_EQ(curve.threshold, 0.5F);
  ModelConfidence empty = FitConfidence({});
  LimitWrongAnswers({}, 0.005, empty);
  EXPECT_EQ(empty.threshold, 0.5F);
}

}  // namespace
}  // namespace viewfix
