// SPDX-License-Identifier: BSD-3-Clause
#include "engine/scoring/scoring.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

namespace viewfix {
namespace {

// Random weights as a model holds them.
std::vector<std::uint8_t> RandomWeights(int words, int pairs, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<std::uint8_t> packed(std::size_t(words) * PackedWeights(pairs));
  for (std::uint8_t& both : packed) both = static_cast<std::uint8_t>(random());
  return packed;
}

int WeightIn(std::span<const std::uint8_t> packed, int pairs, int word, int pair) {
  const std::size_t row = PackedWeights(pairs);
  return WeightOf(packed.subspan(word * row, row), pair);
}

// Three locations with 2, 1 and 2 pairs over six words.
struct Fixture {
  std::vector<std::uint16_t> location = {0, 0, 1, 2, 2};
  std::vector<std::uint16_t> view = {0, 1, 0, 0, 1};
  std::vector<float> bias = {0.1F, -0.2F, 0.3F, 0, -1};
  std::vector<float> scale = {0.01F, 0.02F, 0.005F, 0.01F, 0.5F};
  std::vector<std::uint8_t> weights = RandomWeights(6, 5, 5);
  ModelScoring model;

  Fixture() {
    model.num_locations = 3;
    model.num_views = 2;
    model.num_pairs = 5;
    model.pair_location = location;
    model.pair_view = view;
    model.bias = bias;
    model.weight_scale = scale;
    model.weights = weights;
  }
};

Histogram SomeHistogram() {
  Histogram histogram;
  histogram.words = {0, 2, 5};
  histogram.counts = {1, 2, 1};
  histogram.values = {0.5F, 0.70710678F, 0.5F};
  return histogram;
}

TEST(ScorePairs, IsEquation5) {
  const Fixture f;
  const Histogram h = SomeHistogram();
  std::vector<float> scores(5);
  ScorePairs(f.model, h, scores);
  for (int p = 0; p < 5; ++p) {
    double expected = f.bias[p];
    for (int i = 0; i < h.size(); ++i) {
      expected += double{f.scale[p]} * WeightIn(f.weights, 5, h.words[i], p) * h.values[i];
    }
    EXPECT_NEAR(scores[p], expected, 1e-5) << p;
  }
}

// More pairs than one block holds, more words than are added together, and neither a multiple.
TEST(ScorePairs, AddsWordAfterWordOnEveryPath) {
  constexpr int kPairs = 2 * 8192 + 37;
  constexpr int kWords = 11;
  const std::vector<std::uint8_t> weights = RandomWeights(kWords, kPairs, 6);
  const std::vector<float> bias(kPairs, 0.25F), scale(kPairs, 0.003F);
  ModelScoring model;
  model.num_pairs = kPairs;
  model.bias = bias;
  model.weight_scale = scale;
  model.weights = weights;
  Histogram histogram;
  std::vector<float> expected(kPairs, 0);
  for (int w = 0; w < kWords; ++w) {
    histogram.words.push_back(static_cast<std::uint16_t>(w));
    histogram.values.push_back(0.1F + 0.037F * static_cast<float>(w));
    for (int p = 0; p < kPairs; ++p) {
      expected[p] += histogram.values[w] * static_cast<float>(WeightIn(weights, kPairs, w, p));
    }
  }
  for (float& score : expected) score = 0.25F + 0.003F * score;
  for (const CpuPath path : CpuPathsHere()) {
    std::vector<float> scores(kPairs);
    ScorePairs(model, histogram, scores, path);
    EXPECT_EQ(scores, expected) << static_cast<int>(path);
  }
}

TEST(ScorePairs, EmptyHistogramScoresTheBias) {
  const Fixture f;
  std::vector<float> scores(5, 7.0F);
  ScorePairs(f.model, Histogram(), scores);
  EXPECT_THAT(scores, ::testing::ElementsAreArray(f.bias));
}

TEST(ScoreLocations, BestPairAndSum) {
  Fixture f;
  const std::vector<float> pairs = {1, 3, -2, 0.5F, 0.25F};
  std::vector<float> locations(3);
  f.model.location_rule = LocationRule::kBestPair;
  ScoreLocations(f.model, pairs, locations);
  EXPECT_THAT(locations, ::testing::ElementsAre(3, -2, 0.5F));
  f.model.location_rule = LocationRule::kSumOfPairs;
  ScoreLocations(f.model, pairs, locations);
  EXPECT_THAT(locations, ::testing::ElementsAre(4, -2, 0.75F));
}

TEST(BestPairOf, HighestAndLowestIndexAmongEquals) {
  const Fixture f;
  EXPECT_EQ(BestPairOf(f.model, std::vector<float>{1, 3, 9, 0, 0}, 0), 1);
  EXPECT_EQ(BestPairOf(f.model, std::vector<float>{1, 3, 9, 0, 0}, 1), 2);
  EXPECT_EQ(BestPairOf(f.model, std::vector<float>{1, 3, 9, 0, 0}, 2), 3);
}

TEST(AddKeyframeSimilarity, AddsTheMostSimilarOfEachPair) {
  Fixture f;
  f.model.keyframe_weight = 2;
  const std::vector<std::uint16_t> pair = {0, 0, 2, 4};
  ModelKeyframes keyframes;
  keyframes.size = 4;
  keyframes.pair = pair;
  std::vector<float> scores(5, 1.0F);
  AddKeyframeSimilarity(f.model, keyframes, std::vector<float>{-0.1F, 0.25F, 0.5F, -0.5F}, scores);
  EXPECT_THAT(scores, ::testing::ElementsAre(1.5F, 0.0F, 2.0F, 0.0F, 0.0F));
}

TEST(LikenessOfLocations, IsThatOfTheMostSimilarKeyframe) {
  Fixture f;
  const std::vector<std::uint16_t> pair = {0, 0, 1};
  ModelKeyframes keyframes;
  keyframes.size = 3;
  keyframes.pair = pair;
  std::vector<float> likeness(3, 9.0F);
  LikenessOfLocations(f.model, keyframes, std::vector<float>{-0.1F, 0.25F, 0.1F}, likeness);
  std::vector<float> expected(3, kNoSimilarity);
  for (int k = 0; k < 3; ++k) {
    float& best = expected[f.model.pair_location[pair[k]]];
    best = std::max(best, std::vector<float>{-0.1F, 0.25F, 0.1F}[k]);
  }
  EXPECT_THAT(likeness, ::testing::ElementsAreArray(expected));
}

}  // namespace
}  // namespace viewfix
