// SPDX-License-Identifier: BSD-3-Clause
#include "engine/retrieval/retrieval.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "models/model_view.h"
#include "tests/testing/tiny_model.h"

namespace viewfix {
namespace {

constexpr int kWords = 32;

Histogram HistogramOf(const ModelKeyframes& keyframes, int k, HistogramMap map) {
  std::vector<std::uint16_t> words;
  int word = -1;
  for (std::uint32_t j = keyframes.word_begin[k]; j < keyframes.word_begin[k + 1]; ++j) {
    word += StepOf(keyframes.words[j]);
    words.insert(words.end(), CountOf(keyframes.words[j]), static_cast<std::uint16_t>(word));
  }
  Histogram histogram;
  HistogramBuilder(kWords, static_cast<int>(words.size()), 1, map).Build(words, histogram);
  return histogram;
}

double SquaredDistance(const Histogram& a, const Histogram& b) {
  std::vector<double> difference(kWords, 0);
  for (int i = 0; i < a.size(); ++i) difference[a.words[i]] += double{a.values[i]};
  for (int i = 0; i < b.size(); ++i) difference[b.words[i]] -= double{b.values[i]};
  double sum = 0;
  for (const double d : difference) sum += d * d;
  return sum;
}

class RetrievalTest : public ::testing::TestWithParam<HistogramMap> {
 protected:
  RetrievalTest()
      : file_(TinyModel()),
        model_(*ModelView::Open(file_)),
        retrieval_(model_.keyframes(), GetParam(), kWords, model_.scoring().num_pairs) {}

  std::vector<std::uint8_t> file_;
  ModelView model_;
  Retrieval retrieval_;
};

TEST_P(RetrievalTest, AKeyframeIsNearestToItself) {
  for (int k = 0; k < model_.keyframes().size; ++k) {
    retrieval_.SetQuery(HistogramOf(model_.keyframes(), k, GetParam()));
    std::vector<float> similarities(model_.keyframes().size);
    retrieval_.Similarities(similarities);
    EXPECT_EQ(std::max_element(similarities.begin(), similarities.end()) - similarities.begin(), k);
  }
}

TEST_P(RetrievalTest, SimilarityOrdersAsDistanceDoes) {
  const ModelKeyframes& keyframes = model_.keyframes();
  const Histogram query = HistogramOf(keyframes, 3, GetParam());
  retrieval_.SetQuery(HistogramOf(keyframes, 5, GetParam()));  // must be forgotten
  retrieval_.SetQuery(query);
  double query_norm2 = 0;
  for (const float value : query.values) query_norm2 += double{value} * value;
  std::vector<float> similarities(keyframes.size);
  retrieval_.Similarities(similarities);
  for (int k = 0; k < keyframes.size; ++k) {
    const double distance2 = SquaredDistance(query, HistogramOf(keyframes, k, GetParam()));
    EXPECT_NEAR(query_norm2 - 2 * double{similarities[k]}, distance2, 1e-5) << k;
  }
}

TEST_P(RetrievalTest, APairsKeyframesFollowEachOther) {
  for (int pair = 0; pair < model_.scoring().num_pairs; ++pair) {
    for (int k = retrieval_.FirstOf(pair); k < retrieval_.LastOf(pair); ++k) {
      EXPECT_EQ(model_.keyframes().pair[k], pair);
    }
  }
  EXPECT_EQ(retrieval_.LastOf(model_.scoring().num_pairs - 1), model_.keyframes().size);
}

INSTANTIATE_TEST_SUITE_P(Maps, RetrievalTest,
                         ::testing::Values(HistogramMap::kL1, HistogramMap::kHellinger));

}  // namespace
}  // namespace viewfix
