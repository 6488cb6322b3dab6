// SPDX-License-Identifier: BSD-3-Clause
#include "engine/image/integral_image.h"

#include <gtest/gtest.h>

#include "tests/engine/image/test_image.h"

namespace viewfix {
namespace {

// The continued image's pixel, by walking and turning at each edge.
int MirroredPixel(const TestImage& image, int x, int y) {
  while (x < 0 || x >= image.width) x = x < 0 ? -1 - x : 2 * image.width - 1 - x;
  while (y < 0 || y >= image.height) y = y < 0 ? -1 - y : 2 * image.height - 1 - y;
  return image.At(x, y);
}

int SumPixels(const TestImage& image, int x0, int y0, int x1, int y1) {
  int sum = 0;
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; ++x) sum += MirroredPixel(image, x, y);
  }
  return sum;
}

TEST(IntegralImage, BoxSumsEqualAddingPixels) {
  const TestImage image = NoiseImage(37, 23, 1, 5);
  IntegralImage integral(40, 9);
  integral.Compute(image.View());
  TestRandom random(2);
  for (int trial = 0; trial < 500; ++trial) {
    const int x0 = random.Below(37 + 18) - 9;
    const int y0 = random.Below(23 + 18) - 9;
    const int x1 = x0 + random.Below(37 + 9 - x0 + 1);
    const int y1 = y0 + random.Below(23 + 9 - y0 + 1);
    ASSERT_EQ(integral.BoxSum(x0, y0, x1, y1), SumPixels(image, x0, y0, x1, y1))
        << x0 << " " << y0 << " " << x1 << " " << y1;
  }
}

TEST(IntegralImage, MirrorsAgainAndAgainWhereTheBorderExceedsTheImage) {
  const TestImage image = NoiseImage(3, 2, 3);
  IntegralImage integral(3, 20);
  integral.Compute(image.View());
  EXPECT_EQ(integral.BoxSum(-20, -20, 23, 22), SumPixels(image, -20, -20, 23, 22));
  EXPECT_EQ(integral.BoxSum(22, 21, 23, 22), MirroredPixel(image, 22, 21));
}

TEST(IntegralImage, OnePixelFillsItsBorder) {
  TestImage image(1, 1);
  image.At(0, 0) = 7;
  IntegralImage integral(1, 5);
  integral.Compute(image.View());
  EXPECT_EQ(integral.BoxSum(-5, -5, 6, 6), 7 * 11 * 11);
}

TEST(IntegralImage, IsReusableForOtherSizes) {
  IntegralImage integral(64, 4);
  integral.Compute(NoiseImage(64, 64, 4).View());
  const TestImage second = NoiseImage(17, 50, 5);
  integral.Compute(second.View());
  EXPECT_EQ(integral.width(), 17);
  EXPECT_EQ(integral.height(), 50);
  EXPECT_EQ(integral.BoxSum(-4, -4, 21, 54), SumPixels(second, -4, -4, 21, 54));
}

TEST(IntegralImage, BoxesAreExactWhereTheSumsWrapAround) {
  // 4400 x 4400 white pixels with their border sum to more than 2^32.
  TestImage image(4400, 4400);
  for (std::uint8_t& pixel : image.pixels) pixel = 255;
  IntegralImage integral(4400, 100);
  integral.Compute(image.View());
  EXPECT_EQ(integral.BoxSum(4300, 4300, 4500, 4500), 255 * 200 * 200);
}

}  // namespace
}  // namespace viewfix
