// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/score_training.h"

#include <gtest/gtest.h>

#include <random>

#include "firmware_tools/training/histograms.h"

namespace viewfix {
namespace {

constexpr int kWords = 40;

// Three locations of two views, ten images each: words drawn from the location's and the
// view's own parts of the vocabulary.
struct Site {
  std::vector<Histogram> histograms;
  Labels labels;
  Eigen::MatrixXf gram;
  Eigen::MatrixXf similarities;

  explicit Site(bool global_views) {
    std::mt19937 random(3);
    HistogramBuilder builder(kWords, 100, 1, HistogramMap::kHellinger);
    labels.locations = {"a", "b", "c"};
    labels.views = {"left", "right"};
    labels.pair_location = {0, 0, 1, 1, 2, 2};
    labels.pair_view = {0, 1, 0, 1, 0, 1};
    labels.global_views = global_views;
    for (int i = 0; i < 60; ++i) {
      const int pair = i / 10;
      std::vector<std::uint16_t> words;
      for (int w = 0; w < 100; ++w) {
        const int own = w % 3 == 0 ? 5 * pair : 0;
        words.push_back(static_cast<std::uint16_t>(own + random() % (w % 3 == 0 ? 5 : kWords)));
      }
      histograms.emplace_back();
      builder.Build(words, histograms.back());
      labels.image_idxs.push_back(i);
      labels.location.push_back(pair / 2);
      labels.pair.push_back(pair);
    }
    gram = GramMatrix(histograms, kWords, 1);
    similarities = KeyframeSimilarities(histograms, histograms, kWords, 1);
  }
};

double ScoreOf(const ScoreModel& model, const Histogram& h, int pair) {
  double score = model.bias[pair];
  for (int e = 0; e < h.size(); ++e) score += double{model.weights(h.words[e], pair)} * h.values[e];
  return score;
}

TEST(GramMatrix, IsSymmetricWithUnitDiagonal) {
  const Site site(true);
  EXPECT_EQ(site.gram, site.gram.transpose());
  EXPECT_NEAR(site.gram.diagonal().minCoeff(), 1, 1e-5);
}

TEST(KeyframeSimilarities, OrderAsDistancesDo) {
  const Site site(true);
  const Eigen::MatrixXf& s = site.similarities;
  for (int k = 0; k < 60; ++k) {
    EXPECT_NEAR(s(k, 7), site.gram(k, 7) - 0.5F, 1e-5);  // of unit histograms
  }
}

class ScoreTraining : public ::testing::TestWithParam<bool> {};

// Equation (5) gives what the sum over samples, eq. (4), gives.
TEST_P(ScoreTraining, CollapsedWeightsAgreeWithTheSum) {
  const Site site(GetParam());
  const ScoreOptions options = {.c = 10, .beta = 0.5};
  const ScoreModel collapsed =
      TrainScores(site.labels, site.gram, site.histograms, kWords, options, 1, {});
  const std::vector<bool> used(60, true);
  for (int location = 0; location < 3; ++location) {
    const LocationModel model = TrainLocation(site.labels, site.gram, location, used, options);
    for (int s = 0; s < 60; s += 7) {
      const auto scores = ScoreSample(model, site.gram, s);
      for (std::size_t t = 0; t < scores.size(); ++t) {
        EXPECT_NEAR(scores[t], ScoreOf(collapsed, site.histograms[s], model.pairs[t]), 1e-3);
      }
    }
  }
}

TEST_P(ScoreTraining, HeldOutImagesAreFound) {
  const Site site(GetParam());
  const std::vector<int> fold = HeldOutBlocks(site.labels, 5);
  const std::vector<ScoreOptions> candidates = {{.c = 10}};
  const auto results = CrossValidate(site.labels, site.gram, site.similarities, fold, 5, candidates, 2, {});
  ASSERT_EQ(results.size(), 1U);
  EXPECT_EQ(results[0].predictions.size(), 60U);
  EXPECT_GT(results[0].location_accuracy, 0.9);
}

TEST_P(ScoreTraining, DoesNotDependOnTheNumberOfThreads) {
  const Site site(GetParam());
  const auto one = TrainScores(site.labels, site.gram, site.histograms, kWords, {}, 1, {});
  const auto three = TrainScores(site.labels, site.gram, site.histograms, kWords, {}, 3, {});
  EXPECT_EQ(one.weights, three.weights);
  EXPECT_EQ(one.bias, three.bias);
}

INSTANTIATE_TEST_SUITE_P(Views, ScoreTraining, ::testing::Bool());

TEST(TrainLocation, AViewThatNoOtherLocationHasStillHasNegatives) {
  Site site(true);
  site.labels.views = {"back", "left", "right"};
  for (int& view : site.labels.pair_view) ++view;
  site.labels.pair_view[0] = 0;  // location a's first view is seen nowhere else
  const LocationModel model =
      TrainLocation(site.labels, site.gram, 0, std::vector<bool>(60, true), {});
  for (const double bias : model.bias) EXPECT_FALSE(std::isnan(bias));
}

TEST(HeldOutBlocks, AreContiguousAndEvenlyFilled) {
  const Site site(true);
  const std::vector<int> fold = HeldOutBlocks(site.labels, 5);
  for (int i = 1; i < 60; ++i) {
    if (site.labels.pair[i] == site.labels.pair[i - 1]) {
      EXPECT_GE(fold[i], fold[i - 1]);
      EXPECT_LE(fold[i], fold[i - 1] + 1);
    }
  }
  for (int f = 0; f < 5; ++f) EXPECT_EQ(std::count(fold.begin(), fold.end(), f), 12);
}

TEST(HeldOutBlocks, APairsOnlyImageStays) {
  Labels labels;
  labels.pair_location = {0};
  labels.pair = {0};
  EXPECT_EQ(HeldOutBlocks(labels, 4), std::vector<int>{-1});
}

}  // namespace
}  // namespace viewfix
