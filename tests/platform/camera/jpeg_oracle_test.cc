// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <opencv2/imgcodecs.hpp>

#include "platform/camera/jpeg_decoder.h"
#include "tests/testing/jpeg_encoder.h"

namespace viewfix {
namespace {

constexpr int kWidth = 101;
constexpr int kHeight = 67;

int LargestDifference(const GreyImage& image, const cv::Mat& oracle) {
  if (image.width != oracle.cols || image.height != oracle.rows) return 999;
  int largest = 0;
  for (int y = 0; y < oracle.rows; ++y) {
    for (int x = 0; x < oracle.cols; ++x) {
      largest = std::max(largest, std::abs(image.view().Row(y)[x] - oracle.at<std::uint8_t>(y, x)));
    }
  }
  return largest;
}

// OpenCV applies the EXIF orientation too.
TEST(JpegOracleTest, AgreesWithOpenCv) {
  const std::vector<std::uint8_t> grey = MakeTexture(kWidth, kHeight, 5);
  std::vector<std::uint8_t> rgb;
  for (std::size_t i = 0; i < grey.size(); ++i) {
    rgb.insert(rgb.end(), {grey[i], grey[(i + 500) % grey.size()], grey[i / 2]});
  }
  for (int orientation = 1; orientation <= 8; ++orientation) {
    for (const int quality : {20, 75, 95}) {
      for (const bool progressive : {false, true}) {
        const JpegEncoding encoding = {
            .quality = quality, .progressive = progressive, .app1 = MakeExif(orientation, 0, true)};
        const std::vector<std::uint8_t> jpeg = EncodeJpeg(rgb, kWidth, kHeight, 3, encoding);
        GreyImage image;
        ASSERT_TRUE(DecodeJpeg(jpeg, image).ok());
        EXPECT_LE(LargestDifference(image, cv::imdecode(jpeg, cv::IMREAD_GRAYSCALE)), 1)
            << orientation << " " << quality << " " << progressive;
      }
    }
  }
}

}  // namespace
}  // namespace viewfix
