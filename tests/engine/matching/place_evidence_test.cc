// SPDX-License-Identifier: BSD-3-Clause
#include "engine/matching/place_evidence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "tests/testing/tiny_model.h"

namespace viewfix {
namespace {

using ::testing::Each;

constexpr int kDim = 4;
constexpr int kLocations = 3;
constexpr int kMaxFeatures = 64;
constexpr int kDetails = (kLocations + 1) * 16;

std::vector<int> Row(const std::int8_t* row) { return {row, row + kDim}; }

// Two words, three locations, random codes of two parts.
struct Site {
  Site() {
    std::mt19937 random(3);
    const auto byte = [&](int limit) {
      return static_cast<std::int8_t>(static_cast<int>(random() % (2 * limit + 1)) - limit);
    };
    for (int i = 0; i < 2 * kDim; ++i) words.push_back(byte(40));
    for (int i = 0; i < kCodesOfPart * kDim; ++i) codebook.push_back(byte(20));
    for (int i = 0; i < kDetails * 2; ++i) codes.push_back(static_cast<std::uint8_t>(random()));
  }

  ModelDetails View() const { return {kDetails, 2, rotation, codebook, list_size, codes, 0}; }
  PlaceEvidence Evidence() const { return {words, kDim, View(), kLocations, kMaxFeatures}; }

  // Four of each location (the last stands for the common ones) in each of four lists.
  static int LocationOf(int detail) { return detail / 16; }
  static int WordOf(int detail) { return detail / 8 % 2; }
  static bool IsDark(int detail) { return detail / 4 % 2 == 1; }
  std::vector<int> Descriptor(int detail) const {
    std::vector<int> sum = Row(words.data() + std::size_t(WordOf(detail)) * kDim);
    for (int i = 0; i < kDim; ++i) {
      const int code = codes[std::size_t(detail) * 2 + i / 2];
      sum[i] += codebook[(std::size_t(i / 2) * kCodesOfPart + code) * 2 + i % 2];
    }
    return sum;
  }

  // As the header says it, over whole descriptors.
  std::vector<float> Expected(const std::vector<std::int8_t>& descriptors,
                              const std::vector<Keypoint>& keypoints) const {
    std::vector<float> evidence(kLocations + 1, 0);
    for (std::size_t q = 0; q < keypoints.size(); ++q) {
      std::vector<std::int32_t> nearest(kLocations + 1, PlaceEvidence::kFar * PlaceEvidence::kFar);
      for (int d = 0; d < kDetails; ++d) {
        if (IsDark(d) != (keypoints[q].laplacian_sign < 0)) continue;
        const std::vector<int> detail = Descriptor(d);
        std::int32_t distance2 = 0;
        for (int i = 0; i < kDim; ++i) {
          const int difference = descriptors[q * kDim + i] - detail[i];
          distance2 += difference * difference;
        }
        nearest[LocationOf(d)] = std::min(nearest[LocationOf(d)], distance2);
      }
      const auto best = std::min_element(nearest.begin(), nearest.end());
      std::vector<std::int32_t> sorted = nearest;
      std::sort(sorted.begin(), sorted.end());
      const float gap = static_cast<float>(sorted[1] - sorted[0]) / PlaceEvidence::kUnit;
      evidence[best - nearest.begin()] += gap * std::sqrt(gap);
    }
    evidence.pop_back();  // the common details speak for nobody
    return evidence;
  }

  std::vector<std::int8_t> words;
  std::vector<std::int8_t> rotation = NoRotation(kDim);
  std::vector<std::int8_t> codebook;
  std::vector<std::uint8_t> list_size = std::vector<std::uint8_t>((kLocations + 1) * 4, 4);
  std::vector<std::uint8_t> codes;
};

constexpr std::uint16_t kBothWords[] = {0, 1};

TEST(PlaceEvidence, IsTheGapToTheSecondNearestLocation) {
  const Site site;
  std::mt19937 random(5);
  std::vector<std::int8_t> descriptors;
  std::vector<Keypoint> keypoints(50);
  std::vector<std::uint16_t> words;
  for (Keypoint& keypoint : keypoints) {
    keypoint.laplacian_sign = random() % 2 == 0 ? 1 : -1;
    words.insert(words.end(), std::begin(kBothWords), std::end(kBothWords));
    for (int i = 0; i < kDim; ++i) {
      descriptors.push_back(static_cast<std::int8_t>(static_cast<int>(random() % 101) - 50));
    }
  }
  PlaceEvidence evidence = site.Evidence();
  for (int round = 0; round < 2; ++round) {  // nothing is left over from the first
    evidence.Weigh(descriptors, keypoints, words, 2);
    EXPECT_THAT(evidence.evidence(),
                ::testing::ElementsAreArray(site.Expected(descriptors, keypoints)));
    for (int l = 0; l < kLocations; ++l) {
      EXPECT_EQ(std::count(evidence.choices().begin(),
                           evidence.choices().begin() + static_cast<int>(keypoints.size()), l),
                evidence.votes()[l]);
    }
  }
  EXPECT_GT(*std::max_element(evidence.evidence().begin(), evidence.evidence().end()), 0);
}

// A query that is the detail `d` itself.
std::vector<std::int8_t> QueryOf(const Site& site, int d) {
  std::vector<std::int8_t> descriptor;
  for (const int value : site.Descriptor(d)) descriptor.push_back(static_cast<std::int8_t>(value));
  return descriptor;
}

TEST(PlaceEvidence, WhatEveryLocationHasSaysNothing) {
  Site site;
  std::fill(site.codes.begin(), site.codes.end(), std::uint8_t{7});
  PlaceEvidence evidence = site.Evidence();
  evidence.Weigh(QueryOf(site, 0), std::vector<Keypoint>(1), kBothWords, 2);
  EXPECT_THAT(evidence.evidence(), Each(0));
  EXPECT_EQ(FindBestPlace(evidence.evidence(), evidence.evidence()).location_idx, -1);
}

TEST(PlaceEvidence, ACommonDetailSaysNothing) {
  const Site site;
  PlaceEvidence evidence = site.Evidence();
  const int common = kLocations * 16;
  evidence.Weigh(QueryOf(site, common), std::vector<Keypoint>(1), kBothWords, 2);
  EXPECT_THAT(evidence.evidence(), Each(0));
  evidence.Weigh(QueryOf(site, 0), std::vector<Keypoint>(1), kBothWords, 2);
  EXPECT_GT(evidence.evidence()[0], 0);
}

// Details in a turned space say the same of descriptors and words that lie in the old one.
TEST(PlaceEvidence, ComparesTurnedDescriptors) {
  const Site site;
  Site swapped = site;  // the first two directions change places
  std::swap_ranges(swapped.rotation.begin(), swapped.rotation.begin() + kDim,
                   swapped.rotation.begin() + kDim);
  for (std::size_t code = 0; code < kCodesOfPart; ++code) {
    std::swap(swapped.codebook[code * 2], swapped.codebook[code * 2 + 1]);
  }
  PlaceEvidence plain = site.Evidence(), turned = swapped.Evidence();
  const std::vector<Keypoint> keypoint(1);
  plain.Weigh(QueryOf(site, 5), keypoint, kBothWords, 2);
  turned.Weigh(QueryOf(site, 5), keypoint, kBothWords, 2);
  EXPECT_THAT(turned.evidence(), ::testing::ElementsAreArray(plain.evidence()));
}

TEST(PlaceEvidence, WithoutFeaturesThereIsNone) {
  const Site site;
  PlaceEvidence evidence = site.Evidence();
  evidence.Weigh({}, {}, {}, 2);
  EXPECT_THAT(evidence.evidence(), Each(0));
  EXPECT_THAT(evidence.votes(), Each(0));
}

TEST(ScorePlaces, ALikeViewCountsAgainstALocation) {
  const std::vector<float> evidence = {9, 9, 4};
  const std::vector<float> likeness = {0.5F, 0.25F, 0};
  std::vector<float> scores(3);
  ScorePlaces(evidence, likeness, 2, scores);
  EXPECT_THAT(scores, ::testing::ElementsAre(2, 2.5F, 2));
  const BestPlace best = FindBestPlace(evidence, scores);
  EXPECT_EQ(best.location_idx, 1);
  EXPECT_EQ(best.margin, 0.5F);
}

TEST(FindBestPlace, NoLocationWithoutEvidenceIsBest) {
  const std::vector<float> evidence = {0, 1};
  const BestPlace best = FindBestPlace(evidence, std::vector<float>{5, -1});
  EXPECT_EQ(best.location_idx, 1);
  EXPECT_EQ(best.margin, 0);  // the other is above it: nothing speaks for this one
}

TEST(Turner, RoundsAndCuts) {
  const std::vector<std::int8_t> rotation = {127, 127, 64, -64};
  const std::vector<std::int8_t> descriptor = {100, 99};
  std::vector<std::int8_t> turned(2);
  Turner(rotation, 2).Turn(descriptor.data(), turned.data());
  EXPECT_THAT(turned, ::testing::ElementsAre(127, 1));
}

}  // namespace
}  // namespace viewfix
