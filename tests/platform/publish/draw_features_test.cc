// SPDX-License-Identifier: BSD-3-Clause
#include "platform/publish/draw_features.h"

#include <gmock/gmock.h>

#include <limits>

namespace viewfix {
namespace {

using testing::ElementsAre;

class DrawFeaturesTest : public testing::Test {
 protected:
  // Red, green and blue of a pixel.
  static std::vector<int> At(const RgbImage& image, int x, int y) {
    const auto pixel = image.pixels.begin() + 3 * (std::ptrdiff_t{y} * image.width + x);
    return {pixel, pixel + 3};
  }
  static bool IsGrey(const std::vector<int>& colour) {
    return colour[0] == colour[1] && colour[1] == colour[2];
  }

  YuvImage frame_ = {40, 30, std::vector<std::uint8_t>(40 * 30, 100)};
};

TEST_F(DrawFeaturesTest, TheFrameStaysAsItIsBetweenTheCircles) {
  const SeenPoint points[] = {{10, 10, 5, true}};
  const RgbImage image = DrawFeatures(frame_, points);
  EXPECT_THAT(At(image, 10, 10), ElementsAre(100, 100, 100));
  EXPECT_THAT(At(image, 30, 20), ElementsAre(100, 100, 100));
  EXPECT_FALSE(IsGrey(At(image, 15, 10)));
  EXPECT_FALSE(IsGrey(At(image, 10, 5)));
}

TEST_F(DrawFeaturesTest, WhatMatchesIsGreenAndOnTop) {
  const SeenPoint points[] = {{10, 10, 5, true}, {10, 10, 5, false}, {30, 15, 5, false}};
  const RgbImage image = DrawFeatures(frame_, points);
  const std::vector<int> matched = At(image, 15, 10), unmatched = At(image, 35, 15);
  EXPECT_GT(matched[1], matched[0]);
  EXPECT_GT(unmatched[0], unmatched[1]);
}

TEST_F(DrawFeaturesTest, PointsBeyondThePictureAreHarmless) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  const SeenPoint points[] = {{-1e9F, 5, 5, true}, {5, 1e9F, 5, true},   {kNan, 5, 5, true},
                              {5, 5, kNan, true},  {5, 5, 1e9F, true},   {5, kInfinity, 5, true},
                              {5, 5, 0, true},     {5, 5, -kInfinity, 0}};
  for (const std::uint8_t value : DrawFeatures(frame_, points).pixels) ASSERT_EQ(value, 100);
  const SeenPoint corner[] = {{39, 29, 100, true}};
  EXPECT_EQ(DrawFeatures(frame_, corner).pixels.size(), 3 * frame_.pixels.size());
}

}  // namespace
}  // namespace viewfix
