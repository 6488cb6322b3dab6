// SPDX-License-Identifier: BSD-3-Clause
#include "engine/base/location_name.h"

#include <gtest/gtest.h>

namespace viewfix {
namespace {

TEST(LocationName, LevelsAreTheParts) {
  EXPECT_EQ(LevelsOf("lobby"), 1);
  EXPECT_EQ(LevelsOf("floor10/lobby/desk"), 3);
  EXPECT_EQ(UpToLevel("floor10/lobby/desk", 1), "floor10");
  EXPECT_EQ(UpToLevel("floor10/lobby/desk", 2), "floor10/lobby");
  EXPECT_EQ(UpToLevel("floor10/lobby/desk", 3), "floor10/lobby/desk");
  EXPECT_EQ(UpToLevel("floor10/lobby/desk", 7), "floor10/lobby/desk");
  EXPECT_EQ(UpToLevel("lobby", 0), "");
}

TEST(LocationName, WhatIsCommonIsWholeParts) {
  EXPECT_EQ(CommonLevels("floor1/lobby", "floor1/lift"), 1);
  EXPECT_EQ(CommonLevels("floor1/lobby", "floor10/lobby"), 0);
  EXPECT_EQ(CommonLevels("floor1/lobby", "floor1/lobby"), 2);
  EXPECT_EQ(CommonLevels("floor1", "floor1/lobby"), 1);
  EXPECT_EQ(CommonLevels("a/b/c", "a/x/c"), 1);
}

}  // namespace
}  // namespace viewfix
