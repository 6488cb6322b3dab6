// SPDX-License-Identifier: BSD-3-Clause
// The image folder beside OpenCV.
#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "engine/image/integral_image.h"
#include "engine/image/resize.h"
#include "tests/engine/image/test_image.h"

namespace viewfix {
namespace {

cv::Mat AsMat(const ImageView& view) {
  return cv::Mat(view.height, view.width, CV_8U, const_cast<std::uint8_t*>(view.pixels),
                 std::size_t(view.row_bytes));
}

TEST(ImageOracle, IntegralEqualsOpenCvOfTheMirroredImage) {
  const TestImage image = NoiseImage(83, 41, 1);
  constexpr int kBorder = 30;
  IntegralImage integral(83, kBorder);
  integral.Compute(image.View());
  cv::Mat padded;
  cv::copyMakeBorder(AsMat(image.View()), padded, kBorder, kBorder, kBorder, kBorder,
                     cv::BORDER_REFLECT);
  cv::Mat sums;
  cv::integral(padded, sums, CV_32S);
  for (int y = 0; y < sums.rows; ++y) {
    for (int x = 0; x < sums.cols; ++x) {
      ASSERT_EQ(integral.BoxSum(-kBorder, -kBorder, x - kBorder, y - kBorder), sums.at<int>(y, x));
    }
  }
}

TEST(ImageOracle, ShrinkingIsWithinAGreyLevelOfInterArea) {
  const TestImage image = NoiseImage(640, 360, 2);
  for (const int side : {320, 199, 500, 64}) {
    Shrinker shrinker(side);
    const ImageView small = shrinker.ShrinkToSide(image.View());
    cv::Mat expected;
    cv::resize(AsMat(image.View()), expected, {small.width, small.height}, 0, 0, cv::INTER_AREA);
    EXPECT_LE(cv::norm(AsMat(small), expected, cv::NORM_INF), 1) << side;
  }
}

}  // namespace
}  // namespace viewfix
