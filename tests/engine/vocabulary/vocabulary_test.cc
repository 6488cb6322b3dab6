// SPDX-License-Identifier: BSD-3-Clause
#include "engine/vocabulary/vocabulary.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace viewfix {
namespace {

std::vector<std::int8_t> RandomBytes(int count, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<std::int8_t> bytes(count);
  for (std::int8_t& b : bytes) b = static_cast<std::int8_t>(static_cast<int>(random() % 256) - 128);
  return bytes;
}

int NearestByDistance(std::span<const std::int8_t> descriptor, std::span<const std::int8_t> words,
                      int dim) {
  int best = -1;
  long best_distance = std::numeric_limits<long>::max();
  for (int w = 0; w * dim < static_cast<int>(words.size()); ++w) {
    long distance = 0;
    for (int i = 0; i < dim; ++i) {
      const long d = long{descriptor[i]} - words[w * dim + i];
      distance += d * d;
    }
    if (distance < best_distance) {
      best_distance = distance;
      best = w;
    }
  }
  return best;
}

class NearestWords : public ::testing::TestWithParam<int> {};  // dimension

TEST_P(NearestWords, AgreesWithDistances) {
  const int dim = GetParam();
  const auto words = RandomBytes(70 * dim, 1);
  const auto descriptors = RandomBytes(200 * dim, 2);
  const Vocabulary vocabulary(words, dim);
  std::vector<std::uint16_t> found(200);
  vocabulary.NearestWords(descriptors, 1, found);
  for (int i = 0; i < 200; ++i) {
    const auto descriptor = std::span(descriptors).subspan(i * dim, dim);
    EXPECT_EQ(found[i], NearestByDistance(descriptor, words, dim)) << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Dimensions, NearestWords, ::testing::Values(1, 7, 64, 128));

TEST_P(NearestWords, AreTheSameOnEveryPath) {
  const int dim = GetParam();
  const auto words = RandomBytes(301 * dim, 1);
  const auto descriptors = RandomBytes(45 * dim, 2);
  std::vector<std::uint16_t> expected(45 * 3), found(45 * 3);
  Vocabulary(words, dim, CpuPath::kPlain).NearestWords(descriptors, 3, expected);
  for (const CpuPath path : CpuPathsHere()) {
    Vocabulary(words, dim, path).NearestWords(descriptors, 3, found);
    EXPECT_EQ(found, expected) << static_cast<int>(path);
  }
}

TEST_P(NearestWords, SeveralAreTheNearestInOrder) {
  const int dim = GetParam();
  const auto words = RandomBytes(70 * dim, 1);
  const auto descriptors = RandomBytes(50 * dim, 2);
  std::vector<std::uint16_t> found(50 * 4);
  Vocabulary(words, dim).NearestWords(descriptors, 4, found);
  for (int i = 0; i < 50; ++i) {
    std::vector<std::int8_t> left = words;
    for (int rank = 0; rank < 4; ++rank) {
      const auto descriptor = std::span(descriptors).subspan(i * dim, dim);
      const int nearest = NearestByDistance(descriptor, left, dim);
      EXPECT_EQ(found[i * 4 + rank], nearest) << i << " " << rank;
      // Out of the way: farther from any descriptor than any word.
      for (int d = 0; d < dim; ++d) left[nearest * dim + d] = descriptor[d] < 0 ? 127 : -128;
    }
  }
}

TEST(Vocabulary, AsManyRanksAsWords) {
  const std::vector<std::int8_t> words = {100, 0, 50};
  std::vector<std::uint16_t> found(3);
  Vocabulary(words, 1).NearestWords(std::vector<std::int8_t>{60}, 3, found);
  EXPECT_THAT(found, ::testing::ElementsAre(2, 0, 1));
}

TEST(Vocabulary, ExtremeBytesDoNotOverflow) {
  std::vector<std::int8_t> words(2 * 128, -128);
  std::fill(words.begin() + 128, words.end(), std::int8_t{127});
  const Vocabulary vocabulary(words, 128);
  const std::vector<std::int8_t> descriptor(128, -128);
  std::vector<std::uint16_t> found(1);
  vocabulary.NearestWords(descriptor, 1, found);
  EXPECT_EQ(found[0], 0);
}

TEST(Vocabulary, LowestIndexAmongEquals) {
  const std::vector<std::int8_t> words = {5, 5, 9, 9, 5, 5};
  const Vocabulary vocabulary(words, 2);
  const std::vector<std::int8_t> descriptor = {5, 5};
  std::vector<std::uint16_t> found(1);
  vocabulary.NearestWords(descriptor, 1, found);
  EXPECT_EQ(found[0], 0);
}

TEST(Histogram, CountsAndNormalizes) {
  const std::vector<std::uint16_t> words = {3, 1, 3, 3};
  Histogram histogram;
  HistogramBuilder(5, 10, 1, HistogramMap::kL1).Build(words, histogram);
  EXPECT_THAT(histogram.words, ::testing::ElementsAre(1, 3));
  EXPECT_THAT(histogram.counts, ::testing::ElementsAre(1, 3));
  EXPECT_THAT(histogram.values, ::testing::ElementsAre(0.25F, 0.75F));
}

TEST(Histogram, AFeatureVotesHalfForEachNextWord) {
  const std::vector<std::uint16_t> words = {3, 1, 0, 3, 2, 1};  // two features, three words each
  Histogram histogram;
  HistogramBuilder(5, 10, 3, HistogramMap::kL1).Build(words, histogram);
  EXPECT_THAT(histogram.words, ::testing::ElementsAre(0, 1, 2, 3));
  EXPECT_THAT(histogram.counts, ::testing::ElementsAre(1, 3, 2, 8));
  EXPECT_FLOAT_EQ(histogram.values[3], 8.0F / 14);
}

TEST(Histogram, HellingerMapHasUnitLength) {
  std::mt19937 random(3);
  std::vector<std::uint16_t> words(300);
  for (auto& word : words) word = static_cast<std::uint16_t>(random() % 40);
  Histogram histogram;
  HistogramBuilder(40, 300, 1, HistogramMap::kHellinger).Build(words, histogram);
  double norm2 = 0;
  for (const float value : histogram.values) norm2 += double{value} * value;
  EXPECT_NEAR(norm2, 1, 1e-5);
}

TEST(Histogram, BuilderForgetsTheLastImage) {
  HistogramBuilder builder(8, 4, 1, HistogramMap::kHellinger);
  Histogram first;
  Histogram second;
  builder.Build(std::vector<std::uint16_t>{1, 2, 2}, first);
  builder.Build(std::vector<std::uint16_t>{5}, second);
  EXPECT_THAT(second.words, ::testing::ElementsAre(5));
  EXPECT_THAT(second.values, ::testing::ElementsAre(1.0F));
}

TEST(Histogram, CountsSaturate) {
  Histogram histogram;
  HistogramBuilder(2, 1000, 1, HistogramMap::kL1)
      .Build(std::vector<std::uint16_t>(1000, 1), histogram);
  EXPECT_THAT(histogram.counts, ::testing::ElementsAre(255));
  EXPECT_THAT(histogram.values, ::testing::ElementsAre(1.0F));
}

TEST(Histogram, NoWordsNoEntries) {
  Histogram histogram;
  HistogramBuilder(2, 10, 1, HistogramMap::kL1).Build({}, histogram);
  EXPECT_EQ(histogram.size(), 0);
}

}  // namespace
}  // namespace viewfix
