// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/experiment/splits.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace viewfix {
namespace {

// Three groups of 20, one of 2.
std::vector<int> Groups() {
  std::vector<int> groups;
  for (int i = 0; i < 60; ++i) groups.push_back(i / 20);
  groups.push_back(3);
  groups.push_back(3);
  return groups;
}

std::vector<int> TestsOf(const Split& split, const std::vector<int>& groups, int group) {
  std::vector<int> tests;
  for (int s = 0; s < static_cast<int>(split.size()); ++s) {
    if (split[s] && groups[s] == group) tests.push_back(s);
  }
  return tests;
}

TEST(DrawSplits, TakesThreeOfTwentyAndLeavesTwoForTraining) {
  const std::vector<int> groups = Groups();
  const auto splits = DrawSplits(groups, Split(62, false), {.count = 5});
  ASSERT_EQ(splits.size(), 5U);
  for (const Split& split : splits) {
    for (int g = 0; g < 3; ++g) EXPECT_EQ(TestsOf(split, groups, g).size(), 3U);
    EXPECT_TRUE(TestsOf(split, groups, 3).empty());
  }
  EXPECT_NE(splits[0], splits[1]);
  EXPECT_EQ(splits, DrawSplits(groups, Split(62, false), {.count = 5}));
  EXPECT_NE(splits, DrawSplits(groups, Split(62, false), {.count = 5, .seed = 2}));
}

TEST(DrawSplits, BeginsWithTheOwnSplitAndKeepsItsNumbers) {
  const std::vector<int> groups = Groups();
  Split own(62, false);
  for (const int s : {0, 7, 21}) own[s] = true;
  const auto splits = DrawSplits(groups, own, {.count = 4});
  EXPECT_EQ(splits.front(), own);
  for (const Split& split : splits) {
    EXPECT_EQ(TestsOf(split, groups, 0).size(), 2U);
    EXPECT_EQ(TestsOf(split, groups, 1).size(), 1U);
    EXPECT_TRUE(TestsOf(split, groups, 2).empty());
  }
}

TEST(DrawSplits, RunsFollowOneAnother) {
  const std::vector<int> groups = Groups();
  for (const Split& split : DrawSplits(groups, Split(62, false), {.count = 8, .as_runs = true})) {
    for (int g = 0; g < 3; ++g) {
      const std::vector<int> tests = TestsOf(split, groups, g);
      ASSERT_EQ(tests.size(), 3U);
      EXPECT_EQ(tests.back() - tests.front(), 2);
    }
  }
}

// Each image is drawn about as often as any other: 3 of 20 times.
TEST(DrawSplits, IsFair) {
  const std::vector<int> groups = Groups();
  std::vector<int> drawn(62, 0);
  for (const Split& split : DrawSplits(groups, Split(62, false), {.count = 1000})) {
    for (std::size_t s = 0; s < split.size(); ++s) drawn[s] += split[s] ? 1 : 0;
  }
  EXPECT_GT(*std::min_element(drawn.begin(), drawn.begin() + 60), 110);
  EXPECT_LT(*std::max_element(drawn.begin(), drawn.begin() + 60), 190);
}

}  // namespace
}  // namespace viewfix
