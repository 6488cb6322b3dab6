// SPDX-License-Identifier: BSD-3-Clause
#include "engine/matching/place_evidence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
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

struct Said {
  std::vector<float> evidence;
  std::vector<int> close_votes;

  // Of a feature whose nearest detail of each location is so far away (squared), as the header
  // says it.
  void Vote(const std::vector<std::int32_t>& nearest) {
    const auto best = std::min_element(nearest.begin(), nearest.end());
    std::vector<std::int32_t> sorted = nearest;
    std::sort(sorted.begin(), sorted.end());
    const float gap = static_cast<float>(sorted[1] - sorted[0]) / PlaceEvidence::kUnit;
    evidence[best - nearest.begin()] += gap * std::sqrt(gap);
    constexpr std::int32_t kClose2 = PlaceEvidence::kClose * PlaceEvidence::kClose;
    if (gap > 0 && *best < kClose2) ++close_votes[best - nearest.begin()];
  }
};

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
  PlaceEvidence Evidence(CpuPath path = BestCpuPath()) const {
    return {words, kDim, View(), kLocations, kMaxFeatures, path};
  }

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

  // Over whole descriptors.
  Said Expected(const std::vector<std::int8_t>& descriptors,
                const std::vector<Keypoint>& keypoints) const {
    Said said = {std::vector<float>(kLocations + 1), std::vector<int>(kLocations + 1)};
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
      said.Vote(nearest);
    }
    said.evidence.pop_back();  // the common details speak for nobody
    said.close_votes.pop_back();
    return said;
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
  for (const CpuPath path : CpuPathsHere()) {
    PlaceEvidence evidence = site.Evidence(path);
    for (int round = 0; round < 2; ++round) {  // nothing is left over from the first
      evidence.Weigh(descriptors, keypoints, words, 2);
      const Said expected = site.Expected(descriptors, keypoints);
      EXPECT_THAT(evidence.evidence(), ::testing::ElementsAreArray(expected.evidence));
      EXPECT_THAT(evidence.close_votes(), ::testing::ElementsAreArray(expected.close_votes));
      for (int l = 0; l < kLocations; ++l) {
        EXPECT_EQ(std::count(evidence.choices().begin(),
                             evidence.choices().begin() + static_cast<int>(keypoints.size()), l),
                  evidence.votes()[l]);
      }
    }
    EXPECT_GT(*std::max_element(evidence.evidence().begin(), evidence.evidence().end()), 0);
    const auto close = evidence.close_votes();
    EXPECT_GT(std::accumulate(close.begin(), close.end(), 0), 0);
    EXPECT_FALSE(std::ranges::equal(close, evidence.votes()));  // some are far
  }
}

// Lists longer than what is looked at together, that begin anywhere. Queries lie near the details,
// whose lengths and products with the codes are as large as the limits of words and codes make
// them.
class LongLists {
 public:
  static constexpr int kDim = 120, kWords = 2, kLocations = 5, kQueries = 200;

  LongLists(int word_limit, int code_limit, int parts = 8) : parts_(parts) {
    words_ = Bytes(kWords * kDim, word_limit);
    codebook_ = Bytes(kCodesOfPart * kDim, code_limit);
    for (int l = 0; l < (kLocations + 1) * 2 * kWords; ++l) {
      list_size_.push_back(static_cast<std::uint8_t>(150 + random_() % 100));
      details_ += list_size_.back();
    }
    for (int i = 0; i < details_ * parts_; ++i) {
      codes_.push_back(static_cast<std::uint8_t>(random_()));
    }
    for (int q = 0; q < kQueries; ++q) AddQuery(static_cast<int>(random_() % details_));
  }

  std::vector<float> Evidence(CpuPath path, int hidden) const {
    return Evidence(words_, queries_, rotation_, hidden, path);
  }

  // Over whole descriptors.
  std::vector<float> Expected(int hidden) const {
    Said said = {std::vector<float>(kLocations + 1), std::vector<int>(kLocations + 1)};
    std::vector<std::vector<std::int32_t>> nearest(
        kQueries,
        std::vector<std::int32_t>(kLocations + 1, PlaceEvidence::kFar * PlaceEvidence::kFar));
    for (int d = 0; d < details_; ++d) {
      const int list = ListOf(d), location = list / (2 * kWords);
      const std::vector<int> detail = Descriptor(d);
      // Bright and dark queries take turns.
      for (int q = list % 2; q < kQueries && location != hidden; q += 2) {
        std::int32_t distance2 = 0;
        for (int i = 0; i < kDim; ++i) {
          const int difference = queries_[q * kDim + i] - detail[i];
          distance2 += difference * difference;
        }
        nearest[q][location] = std::min(nearest[q][location], distance2);
      }
    }
    for (const std::vector<std::int32_t>& of_query : nearest) said.Vote(of_query);
    said.evidence.pop_back();
    return said.evidence;
  }

  // Everything moved in all directions: no distance changes, but lengths do.
  std::vector<float> EvidenceMoved(std::int8_t by, CpuPath path) const {
    const auto moved = [by](std::vector<std::int8_t> values) {
      for (std::int8_t& value : values) value = static_cast<std::int8_t>(value + by);
      return values;
    };
    return Evidence(moved(words_), moved(queries_), rotation_, -1, path);
  }

  // The same descriptors followed by numbers that the rotation leaves out.
  std::vector<float> EvidenceAmongMore(CpuPath path) const {
    constexpr int kMore = kDim + 6;
    const auto followed = [](const std::vector<std::int8_t>& rows, std::int8_t by) {
      std::vector<std::int8_t> longer;
      for (auto row = rows.begin(); row != rows.end(); row += kDim) {
        longer.insert(longer.end(), row, row + kDim);
        longer.insert(longer.end(), kMore - kDim, by);
      }
      return longer;
    };
    return Evidence(followed(words_, 90), followed(queries_, -90), followed(rotation_, 0), -1,
                    path);
  }

 private:
  std::vector<float> Evidence(const std::vector<std::int8_t>& words,
                              const std::vector<std::int8_t>& queries,
                              const std::vector<std::int8_t>& rotation, int hidden,
                              CpuPath path) const {
    const ModelDetails details = {details_, parts_, rotation, codebook_, list_size_, codes_, 0};
    const int dim = static_cast<int>(words.size()) / kWords;
    PlaceEvidence evidence(words, dim, details, kLocations, kQueries, path);
    std::vector<Keypoint> keypoints(kQueries);
    std::vector<std::uint16_t> nearest;
    for (int q = 0; q < kQueries; ++q) {
      keypoints[q].laplacian_sign = q % 2 == 0 ? 1 : -1;
      nearest.insert(nearest.end(), {std::uint16_t(q / 2 % 2), std::uint16_t(1 - q / 2 % 2)});
    }
    evidence.Weigh(queries, keypoints, nearest, 2, hidden);
    return {evidence.evidence().begin(), evidence.evidence().end()};
  }

  std::vector<std::int8_t> Bytes(int count, int limit) {
    std::vector<std::int8_t> bytes;
    for (int i = 0; i < count; ++i) {
      bytes.push_back(static_cast<std::int8_t>(int(random_() % (2 * limit + 1)) - limit));
    }
    return bytes;
  }

  // Of the location's lists: two a word, then the next location's.
  int ListOf(int detail) const {
    int list = 0;
    for (; detail >= list_size_[list]; ++list) detail -= list_size_[list];
    return list;
  }

  std::vector<int> Descriptor(int detail) const {
    const int piece = kDim / parts_;
    std::vector<int> sum(kDim);
    for (int i = 0; i < kDim; ++i) {
      const int code = codes_[std::size_t(detail) * parts_ + i / piece];
      sum[i] = words_[ListOf(detail) / 2 % kWords * kDim + i] +
               codebook_[(std::size_t(i / piece) * kCodesOfPart + code) * piece + i % piece];
    }
    return sum;
  }

  void AddQuery(int detail) {
    const std::vector<std::int8_t> noise = Bytes(kDim, 4);
    const std::vector<int> descriptor = Descriptor(detail);
    for (int i = 0; i < kDim; ++i) {
      queries_.push_back(static_cast<std::int8_t>(std::clamp(descriptor[i] + noise[i], -127, 127)));
    }
  }

  int parts_;
  std::mt19937 random_{7};
  std::vector<std::int8_t> words_, codebook_, queries_, rotation_ = NoRotation(kDim);
  std::vector<std::uint8_t> list_size_, codes_;
  int details_ = 0;
};

// Parts as `train` makes them, and another number.
TEST(PlaceEvidence, IsThatOfWholeDescriptorsOnEveryPath) {
  for (const int parts : {8, 6, 5, 4, 3}) {
    // Usual lengths; products too large to be scanned; squared lengths above 16 bits.
    for (const auto& [word_limit, code_limit] :
         {std::pair(8, 12), std::pair(8, 120), std::pair(60, 9)}) {
      const LongLists site(word_limit, code_limit, parts);
      for (const int hidden : {-1, 2}) {
        const std::vector<float> expected = site.Expected(hidden);
        EXPECT_GT(*std::max_element(expected.begin(), expected.end()), 0);
        for (const CpuPath path : CpuPathsHere()) {
          EXPECT_EQ(site.Evidence(path, hidden), expected)
              << parts << " parts, path " << static_cast<int>(path);
        }
      }
    }
  }
}

TEST(PlaceEvidence, DependsOnDistancesNotOnLengths) {
  const LongLists site(8, 9);
  const std::vector<float> here = site.Evidence(BestCpuPath(), -1);
  EXPECT_GT(*std::max_element(here.begin(), here.end()), 0);
  for (const CpuPath path : CpuPathsHere()) {
    EXPECT_EQ(site.EvidenceMoved(20, path), here) << "squared lengths about " << 64 * 20 * 20;
    EXPECT_EQ(site.EvidenceMoved(50, path), here) << "more than 16 bits hold";
  }
}

// Turned descriptors may be shorter: the numbers that no row of the rotation looks at do not count.
TEST(PlaceEvidence, IsThatOfTheDirectionsKept) {
  const LongLists site(8, 12);
  const std::vector<float> whole = site.Evidence(BestCpuPath(), -1);
  EXPECT_GT(*std::max_element(whole.begin(), whole.end()), 0);
  for (const CpuPath path : CpuPathsHere()) EXPECT_EQ(site.EvidenceAmongMore(path), whole);
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

TEST(LeadOf, GrowsWithTheRootOfCloseVotes) {
  EXPECT_EQ(LeadOf(1.5F, 0, 2), 1.5F);
  EXPECT_EQ(LeadOf(1.5F, 9, 0), 1.5F);
  EXPECT_EQ(LeadOf(1.5F, 9, 2), 7.5F);
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
  Turner(rotation, 2).Turn(descriptor, turned.data());
  EXPECT_THAT(turned, ::testing::ElementsAre(127, 1));
}

}  // namespace
}  // namespace viewfix
