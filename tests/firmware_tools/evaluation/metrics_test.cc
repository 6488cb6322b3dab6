// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/evaluation/metrics.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

namespace viewfix {
namespace {

TEST(Quantile, InterpolatesOrderStatistics) {
  EXPECT_EQ(Quantile({3, 1, 2}, 0.5), 2);
  EXPECT_EQ(Quantile({0, 10}, 0.25), 2.5);
  EXPECT_EQ(Quantile({}, 0.5), std::nullopt);
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(Quantile({1, 2, infinity}, 0.5), 2);
}

TEST(WilsonInterval, KnownValue) {
  const Interval interval = WilsonInterval(86, 90);
  EXPECT_NEAR(interval.low, 0.891, 0.001);
  EXPECT_NEAR(interval.high, 0.983, 0.001);
}

// A predictor whose confidence is the true probability, and one that is too sure.
TEST(CalibrationError, SmallWhereConfidenceIsHonest) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform;
  std::vector<Judgement> honest;
  std::vector<Judgement> boastful;
  for (int i = 0; i < 20000; ++i) {
    const double p = uniform(random);
    const bool right = uniform(random) < p;
    honest.push_back({p, right});
    boastful.push_back({0.5 + p / 2, right});
  }
  EXPECT_LT(ExpectedCalibrationError(honest), 0.02);
  EXPECT_NEAR(ExpectedCalibrationError(boastful), 0.25, 0.02);
  const Interval ci = BootstrapCalibrationError(std::span(boastful).first(500));
  EXPECT_LT(ci.low, 0.25);
  EXPECT_GT(ci.high, 0.2);
}

TEST(BrierScore, AgreesWithItsDefinition) {
  const std::vector<Judgement> judgements = {{0.8, true}, {0.4, false}, {1, true}, {0, true}};
  EXPECT_NEAR(BrierScore(judgements), (0.04 + 0.16 + 0 + 1) / 4, 1e-12);
  EXPECT_NEAR(ConstantBrierScore(judgements), 0.75 * 0.25, 1e-12);
}

TEST(AreaUnderRoc, CountsPairs) {
  EXPECT_EQ(AreaUnderRoc({{0.9, true}, {0.1, false}}), 1);
  EXPECT_EQ(AreaUnderRoc({{0.1, true}, {0.9, false}}), 0);
  EXPECT_EQ(AreaUnderRoc({{0.5, true}, {0.5, false}}), 0.5);
  EXPECT_EQ(AreaUnderRoc({{0.5, true}}), std::nullopt);
  EXPECT_EQ(AreaUnderRoc({{0.9, true}, {0.5, false}, {0.4, true}, {0.1, false}}), 0.75);
}

TEST(ReliabilityDiagram, HasBinsOfEqualMass) {
  std::vector<Judgement> judgements;
  for (int i = 19; i >= 0; --i) judgements.push_back({i / 20.0, i % 4 != 0});
  const auto bins = ReliabilityDiagram(judgements, 5);
  ASSERT_EQ(bins.size(), 5U);
  for (std::size_t b = 0; b < bins.size(); ++b) {
    EXPECT_EQ(bins[b].count, 4);
    EXPECT_EQ(bins[b].hits, 3);
    EXPECT_EQ(bins[b].right, 0.75);
    EXPECT_NEAR(bins[b].confidence, (4 * static_cast<double>(b) + 1.5) / 20, 1e-12);
  }
  EXPECT_EQ(ReliabilityDiagram({{0.5, true}}, 10).size(), 1U) << "empty bins are left out";
  EXPECT_TRUE(ReliabilityDiagram({}).empty());
}

TEST(RiskCoverageCurve, GoesFromTheSurestToAll) {
  const auto curve =
      RiskCoverageCurve({{0.2, false}, {0.9, true}, {0.5, false}, {0.5, true}, {0.1, true}});
  ASSERT_EQ(curve.size(), 4U) << "equal confidences are one point";
  EXPECT_EQ(curve[0].coverage, 0.2);
  EXPECT_EQ(curve[0].risk, 0);
  EXPECT_EQ(curve[0].confidence, 0.9);
  EXPECT_EQ(curve[1].coverage, 0.6);
  EXPECT_DOUBLE_EQ(curve[1].risk, 1.0 / 3);
  EXPECT_EQ(curve[2].risk, 0.5);
  EXPECT_EQ(curve[3].coverage, 1);
  EXPECT_EQ(curve[3].risk, 0.4);
  EXPECT_TRUE(RiskCoverageCurve({}).empty());
}

TEST(RiskCoverageCurve, KeepsTheLastOfManyPoints) {
  std::vector<Judgement> judgements;
  for (int i = 0; i < 1000; ++i) judgements.push_back({i / 1000.0, i > 500});
  const auto curve = RiskCoverageCurve(judgements, 20);
  ASSERT_EQ(curve.size(), 20U);
  EXPECT_EQ(curve.front().coverage, 0.05);
  EXPECT_EQ(curve.back().coverage, 1);
  EXPECT_NEAR(curve.back().risk, 0.501, 1e-12);
}

TEST(RiskAtCoverage, LooksAtTheSurest) {
  const std::vector<Judgement> judgements = {{0.9, true}, {0.8, true}, {0.7, false}, {0.1, false}};
  EXPECT_EQ(RiskAtCoverage(judgements, 0.5), 0);
  EXPECT_EQ(RiskAtCoverage(judgements, 1), 0.5);
  EXPECT_NEAR(RiskAtCoverage(judgements, 0.75), 1.0 / 3, 1e-12);
}

}  // namespace
}  // namespace viewfix
