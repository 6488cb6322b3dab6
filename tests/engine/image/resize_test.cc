// SPDX-License-Identifier: BSD-3-Clause
#include "engine/image/resize.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "tests/engine/image/test_image.h"

namespace viewfix {
namespace {

TEST(ShrunkSize, KeepsTheShapeAndRounds) {
  EXPECT_EQ(ShrunkSize(1280, 720, 640).width, 640);
  EXPECT_EQ(ShrunkSize(1280, 720, 640).height, 360);
  EXPECT_EQ(ShrunkSize(720, 1280, 640).width, 360);
  EXPECT_EQ(ShrunkSize(1000, 333, 640).height, 213);  // 213.12
  EXPECT_EQ(ShrunkSize(16384, 1, 640).height, 1);
  EXPECT_EQ(ShrunkSize(640, 480, 640).width, 640);
  EXPECT_EQ(ShrunkSize(64, 48, 640).height, 48);
}

TEST(Shrinker, PassesSmallImagesThroughUntouched) {
  const TestImage image = NoiseImage(64, 20, 1, 3);
  Shrinker shrinker(64);
  const ImageView view = shrinker.ShrinkToSide(image.View());
  EXPECT_EQ(view.pixels, image.pixels.data());
  EXPECT_EQ(view.width, 64);
  EXPECT_EQ(view.row_bytes, 67);
}

// The definition: the mean of the piecewise constant source over the target pixel.
double MeanOver(const TestImage& image, double x0, double y0, double x1, double y1) {
  double sum = 0;
  for (int y = int(y0); y < image.height && y < y1; ++y) {
    const double height = std::min(y1, y + 1.0) - std::max(y0, double(y));
    for (int x = int(x0); x < image.width && x < x1; ++x) {
      sum += height * (std::min(x1, x + 1.0) - std::max(x0, double(x))) * image.At(x, y);
    }
  }
  return sum / ((x1 - x0) * (y1 - y0));
}

TEST(Shrinker, AveragesOverAreas) {
  const TestImage image = NoiseImage(97, 61, 2, 2);
  Shrinker shrinker(40);
  const ImageView small = shrinker.ShrinkToSide(image.View());
  ASSERT_EQ(small.width, 40);
  ASSERT_EQ(small.height, 25);
  const double fx = 97.0 / 40;
  const double fy = 61.0 / 25;
  for (int y = 0; y < 25; ++y) {
    for (int x = 0; x < 40; ++x) {
      const double mean = MeanOver(image, x * fx, y * fy, (x + 1) * fx, (y + 1) * fy);
      ASSERT_LE(std::fabs(small.Row(y)[x] - mean), 0.5 + 1e-9) << x << " " << y;
    }
  }
}

TEST(Shrinker, HalvesExactlyWithHalvesRoundedUp) {
  TestImage image(4, 2);
  image.At(0, 0) = 1;
  image.At(1, 0) = 1;  // mean 0.5
  image.At(2, 0) = 1;  // mean 0.25
  Shrinker shrinker(2);
  const ImageView small = shrinker.ShrinkToSide(image.View());
  EXPECT_EQ(small.Row(0)[0], 1);
  EXPECT_EQ(small.Row(0)[1], 0);
}

// Sides that shrink to a whole part of themselves, and those beside them, which do not.
TEST(Shrinker, AveragesSquaresOfWholePixels) {
  for (const int side : {1, 2, 3, 4}) {
    const TestImage image = NoiseImage(35 * side, 21 * side, 4, 5);
    for (const CpuPath path : CpuPathsHere()) {
      Shrinker shrinker(35, path);
      const ImageView small = shrinker.ShrinkToSide(image.View());
      ASSERT_EQ(small.width, 35);
      ASSERT_EQ(small.height, 21);
      for (int y = 0; y < small.height; ++y) {
        for (int x = 0; x < small.width; ++x) {
          int sum = 0;
          for (int i = 0; i < side * side; ++i) {
            sum += image.At(x * side + i % side, y * side + i / side);
          }
          const int area = side * side;
          ASSERT_EQ(small.Row(y)[x], (2 * sum + area) / (2 * area)) << side << " " << x << " " << y;
        }
      }
    }
  }
}

TEST(Shrinker, WhiteStaysWhiteAtTheLargestSize) {
  TestImage image(kMaxImageSide, 3);
  for (std::uint8_t& pixel : image.pixels) pixel = 255;
  Shrinker shrinker(1001);
  const ImageView small = shrinker.ShrinkToSide(image.View());
  ASSERT_EQ(small.width, 1001);
  ASSERT_EQ(small.height, 1);
  for (int x = 0; x < small.width; ++x) ASSERT_EQ(small.Row(0)[x], 255);
}

TEST(Shrinker, KeepsTheMean) {
  const TestImage image = NoiseImage(300, 200, 3);
  Shrinker shrinker(77);
  const ImageView small = shrinker.ShrinkToSide(image.View());
  double sum = 0;
  for (int y = 0; y < small.height; ++y) {
    for (int x = 0; x < small.width; ++x) sum += small.Row(y)[x];
  }
  EXPECT_NEAR(sum / (small.width * small.height), MeanOver(image, 0, 0, 300, 200), 0.1);
}

TEST(Shrinker, ASecondImageLeavesNothingOfTheFirst) {
  Shrinker used(50);
  used.ShrinkToSide(NoiseImage(200, 100, 4).View());
  const TestImage image = NoiseImage(60, 120, 5);
  const ImageView again = used.ShrinkToSide(image.View());
  Shrinker fresh(50);
  const ImageView once = fresh.ShrinkToSide(image.View());
  ASSERT_EQ(again.width, once.width);
  ASSERT_EQ(again.height, once.height);
  for (int y = 0; y < once.height; ++y) {
    for (int x = 0; x < once.width; ++x) ASSERT_EQ(again.Row(y)[x], once.Row(y)[x]);
  }
}

}  // namespace
}  // namespace viewfix
