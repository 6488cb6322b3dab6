// SPDX-License-Identifier: BSD-3-Clause
#include "engine/matching/place_evidence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace viewfix {
namespace {

using ::testing::Each;

constexpr int kDim = 4;
constexpr int kLocations = 3;
constexpr int kMaxFeatures = 64;

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
    for (int list = 0; list < 4; ++list) {
      for (int i = 0; i < 12; ++i) {
        location.push_back(static_cast<std::uint16_t>(i / 4));
        for (int p = 0; p < 2; ++p) codes.push_back(static_cast<std::uint8_t>(random()));
      }
      list_begin.push_back(static_cast<std::uint32_t>(location.size()));
    }
  }

  ModelDetails View() const {
    return {static_cast<int>(location.size()), 2, codebook, list_begin, location, codes};
  }
  PlaceEvidence Evidence() const { return {words, kDim, View(), kLocations, kMaxFeatures}; }

  int WordOf(int detail) const { return detail / 24; }
  bool IsDark(int detail) const { return detail / 12 % 2 == 1; }
  std::vector<int> Descriptor(int detail) const {
    std::vector<int> sum = Row(words.data() + std::size_t(WordOf(detail)) * kDim);
    for (int i = 0; i < kDim; ++i) {
      const int code = codes[std::size_t(detail) * 2 + i / 2];
      sum[i] += codebook[(std::size_t(i / 2) * kCodesOfPart + code) * 2 + i % 2];
    }
    return sum;
  }

  // As the header says it, over whole descriptors.
  std::vector<std::int32_t> Expected(const std::vector<std::int8_t>& descriptors,
                                     const std::vector<Keypoint>& keypoints) const {
    std::vector<std::int32_t> evidence(kLocations, 0);
    for (std::size_t q = 0; q < keypoints.size(); ++q) {
      std::vector<std::int32_t> nearest(kLocations, PlaceEvidence::kFar * PlaceEvidence::kFar);
      for (int d = 0; d < static_cast<int>(location.size()); ++d) {
        if (IsDark(d) != (keypoints[q].laplacian_sign < 0)) continue;
        const std::vector<int> detail = Descriptor(d);
        std::int32_t distance2 = 0;
        for (int i = 0; i < kDim; ++i) {
          const int difference = descriptors[q * kDim + i] - detail[i];
          distance2 += difference * difference;
        }
        nearest[location[d]] = std::min(nearest[location[d]], distance2);
      }
      const auto best = std::min_element(nearest.begin(), nearest.end());
      std::vector<std::int32_t> sorted = nearest;
      std::sort(sorted.begin(), sorted.end());
      evidence[best - nearest.begin()] += sorted[1] - sorted[0];
    }
    return evidence;
  }

  std::vector<std::int8_t> words;
  std::vector<std::int8_t> codebook;
  std::vector<std::uint32_t> list_begin = {0};
  std::vector<std::uint16_t> location;
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

TEST(PlaceEvidence, WhatEveryLocationHasSaysNothing) {
  Site site;
  for (int d = 0; d < static_cast<int>(site.location.size()); ++d) {
    std::fill_n(site.codes.begin() + std::size_t(d) * 2, 2, std::uint8_t{7});
  }
  PlaceEvidence evidence = site.Evidence();
  std::vector<std::int8_t> descriptor;
  for (const int value : site.Descriptor(0)) descriptor.push_back(static_cast<std::int8_t>(value));
  const std::vector<Keypoint> keypoint(1);
  evidence.Weigh(descriptor, keypoint, kBothWords, 2);
  EXPECT_THAT(evidence.evidence(), Each(0));
  EXPECT_EQ(evidence.FindBest().location_idx, -1);
  EXPECT_EQ(evidence.FindBest().margin, 0);
}

TEST(PlaceEvidence, WithoutFeaturesThereIsNone) {
  const Site site;
  PlaceEvidence evidence = site.Evidence();
  evidence.Weigh({}, {}, {}, 2);
  EXPECT_THAT(evidence.evidence(), Each(0));
  EXPECT_THAT(evidence.votes(), Each(0));
}

}  // namespace
}  // namespace viewfix
