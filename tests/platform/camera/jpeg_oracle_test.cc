// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "platform/camera/jpeg_decoder.h"
#include "tests/testing/jpeg_encoder.h"

namespace viewfix {
namespace {

constexpr int kWidth = 101;
constexpr int kHeight = 67;

int LargestDifference(const YuvImage& image, const cv::Mat& oracle) {
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
        YuvImage image;
        ASSERT_TRUE(DecodeJpeg(jpeg, image).ok());
        EXPECT_LE(LargestDifference(image, cv::imdecode(jpeg, cv::IMREAD_GRAYSCALE)), 1)
            << orientation << " " << quality << " " << progressive;
      }
    }
  }
}

// A photograph-like picture, whose chroma libjpeg's encoder halves as the decoder's own does.
TEST(JpegOracleTest, ChromaAgreesWithOpenCv) {
  std::vector<std::uint8_t> rgb;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (const int value : {2 * x, 3 * y, 255 - x - y}) {
        rgb.push_back(static_cast<std::uint8_t>(value));
      }
    }
  }
  for (const int orientation : {1, 6}) {
    const JpegEncoding encoding = {.quality = 95, .app1 = MakeExif(orientation, 0, true)};
    const std::vector<std::uint8_t> jpeg = EncodeJpeg(rgb, kWidth, kHeight, 3, encoding);
    YuvImage image;
    ASSERT_TRUE(DecodeJpeg(jpeg, image).ok());
    const ChromaView chroma = image.view().chroma;
    ASSERT_EQ(chroma.width, (image.width + 1) / 2);
    ASSERT_EQ(chroma.height, (image.height + 1) / 2);
    cv::Mat ycrcb;
    cv::cvtColor(cv::imdecode(jpeg, cv::IMREAD_COLOR), ycrcb, cv::COLOR_BGR2YCrCb);
    for (int y = 0; y + 1 < image.height / 2; ++y) {  // the odd edges have two pixels, not four
      for (int x = 0; x + 1 < image.width / 2; ++x) {
        const cv::Scalar mean = cv::mean(ycrcb({2 * x, 2 * y, 2, 2}));
        ASSERT_NEAR(chroma.cr[y * chroma.row_bytes + x], mean[1], 3) << x << " " << y;
        ASSERT_NEAR(chroma.cb[y * chroma.row_bytes + x], mean[2], 3) << x << " " << y;
      }
    }
  }
}

TEST(JpegOracleTest, AGreyJpegHasNoChroma) {
  YuvImage image;
  ASSERT_TRUE(DecodeJpeg(EncodeJpeg(std::vector<std::uint8_t>(12, 9), 4, 1, 3), image).ok());
  EXPECT_FALSE(image.view().chroma.empty());
  ASSERT_TRUE(DecodeJpeg(EncodeJpeg(std::vector<std::uint8_t>(12, 9), 4, 3, 1), image).ok());
  EXPECT_TRUE(image.view().chroma.empty());
}

}  // namespace
}  // namespace viewfix
