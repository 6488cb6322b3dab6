// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/orient.h"

#include <gtest/gtest.h>

namespace viewfix {
namespace {

// 1 2 3
// 4 5 6
const YuvImage kStored = {3, 2, {1, 2, 3, 4, 5, 6}};

struct Case {
  int orientation;
  int width;
  std::vector<std::uint8_t> upright;
};

TEST(OrientTest, TurnsAsExifSays) {
  const Case cases[] = {
      {1, 3, {1, 2, 3, 4, 5, 6}}, {2, 3, {3, 2, 1, 6, 5, 4}}, {3, 3, {6, 5, 4, 3, 2, 1}},
      {4, 3, {4, 5, 6, 1, 2, 3}}, {5, 2, {1, 4, 2, 5, 3, 6}}, {6, 2, {4, 1, 5, 2, 6, 3}},
      {7, 2, {6, 3, 5, 2, 4, 1}}, {8, 2, {3, 6, 2, 5, 1, 4}}, {0, 3, {1, 2, 3, 4, 5, 6}},
      {9, 3, {1, 2, 3, 4, 5, 6}},
  };
  for (const Case& c : cases) {
    YuvImage upright;
    Orient(kStored, c.orientation, upright);
    EXPECT_EQ(upright.width, c.width) << c.orientation;
    EXPECT_EQ(upright.height, 6 / c.width) << c.orientation;
    EXPECT_EQ(upright.pixels, c.upright) << c.orientation;
  }
}

TEST(OrientTest, ChromaTurnsAlong) {
  YuvImage stored = {5, 3, std::vector<std::uint8_t>(15)};  // of 3 x 2 chroma
  stored.cb = {1, 2, 3, 4, 5, 6};
  stored.cr = {11, 12, 13, 14, 15, 16};
  YuvImage upright;
  Orient(stored, 6, upright);
  EXPECT_EQ(upright.ChromaWidth(), 2);
  EXPECT_EQ(upright.cb, (std::vector<std::uint8_t>{4, 1, 5, 2, 6, 3}));
  EXPECT_EQ(upright.cr, (std::vector<std::uint8_t>{14, 11, 15, 12, 16, 13}));
  Orient(kStored, 6, upright);
  EXPECT_TRUE(upright.view().chroma.empty());
}

TEST(OrientTest, FourQuarterTurnsAreNone) {
  YuvImage image = kStored;
  for (int i = 0; i < 4; ++i) {
    YuvImage turned;
    Orient(image, 6, turned);
    image = turned;
  }
  EXPECT_EQ(image.pixels, kStored.pixels);
}

}  // namespace
}  // namespace viewfix
