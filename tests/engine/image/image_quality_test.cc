// SPDX-License-Identifier: BSD-3-Clause
#include "engine/image/image_quality.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

namespace viewfix {
namespace {

ImageView ViewOf(const cv::Mat& image) {
  return {image.data, image.cols, image.rows, static_cast<std::ptrdiff_t>(image.step)};
}

// Squares of many sizes on a plain ground: edges along x and y, `contrast` grey values high.
cv::Mat Squares(int contrast) {
  cv::Mat image(360, 480, CV_8U, cv::Scalar(60));
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 6; ++x) {
      cv::rectangle(image, cv::Rect(20 + 76 * x, 20 + 86 * y, 30 + 4 * x, 34 + 5 * y),
                    cv::Scalar(60 + contrast), cv::FILLED);
    }
  }
  return image;
}

cv::Mat Blurred(const cv::Mat& image, double sigma) {
  cv::Mat blurred;
  cv::GaussianBlur(image, blurred, {}, sigma);
  return blurred;
}

double BlurOf(const cv::Mat& image) {
  const ImageQuality quality = MeasureQuality(ViewOf(image));
  EXPECT_TRUE(quality.blur_px.has_value());
  return quality.blur_px.value_or(-1);
}

TEST(MeasureQuality, TellsTheBlurOfEdges) {
  for (const int contrast : {40, 120, 190}) {
    EXPECT_LT(BlurOf(Squares(contrast)), 0.8);
    for (const double sigma : {1.5, 2.0, 3.0, 4.0}) {
      EXPECT_NEAR(BlurOf(Blurred(Squares(contrast), sigma)), sigma, 0.15 * sigma)
          << "contrast " << contrast;
    }
  }
}

TEST(MeasureQuality, SeesMotionOfOneDirection) {
  for (const cv::Size motion : {cv::Size(11, 1), cv::Size(1, 11)}) {
    cv::Mat moved;
    cv::blur(Squares(120), moved, motion);
    EXPECT_GT(BlurOf(moved), 2.2);
  }
}

TEST(MeasureQuality, PlainImagesHaveNoBlur) {
  EXPECT_FALSE(MeasureQuality(ViewOf(cv::Mat(100, 100, CV_8U, cv::Scalar(90)))).blur_px);
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(2, 300), cv::Size(300, 2), cv::Size(7, 7)}) {
    cv::Mat noise(size, CV_8U);
    cv::randu(noise, 0, 255);
    MeasureQuality(ViewOf(noise));
  }
  EXPECT_EQ(MeasureQuality({}).mean, 0);
}

TEST(MeasureQuality, CountsDarkAndBrightPixels) {
  cv::Mat image(40, 100, CV_8U, cv::Scalar(100));
  image.colRange(0, 30).setTo(15);
  image.colRange(30, 40).setTo(16);
  image.colRange(80, 100).setTo(248);
  const ImageQuality quality = MeasureQuality(ViewOf(image));
  EXPECT_DOUBLE_EQ(quality.dark_share, 0.3);
  EXPECT_DOUBLE_EQ(quality.bright_share, 0.2);
  EXPECT_DOUBLE_EQ(quality.mean, 0.3 * 15 + 0.1 * 16 + 0.4 * 100 + 0.2 * 248);
}

TEST(MeasureQuality, CallsAnImageWhatAHumanWould) {
  const auto called = [](const cv::Mat& image) {
    const ImageQuality q = MeasureQuality(ViewOf(image));
    return std::string(q.blurred() ? "blurred " : "") + (q.dark() ? "dark " : "") +
           (q.overexposed() ? "overexposed " : "");
  };
  const cv::Mat squares = Squares(120);
  EXPECT_EQ(called(squares), "");
  EXPECT_EQ(called(Blurred(squares, 1.5)), "");
  EXPECT_EQ(called(Blurred(squares, 4)), "blurred ");
  EXPECT_EQ(called(squares * 0.15), "dark ");
  EXPECT_EQ(called(squares * 0.4), "");
  EXPECT_EQ(called(squares + 180), "overexposed ");
  EXPECT_EQ(called(squares + 60), "");
}

TEST(MeasureQuality, ReadsRowsWithPadding) {
  const cv::Mat wide = Blurred(Squares(120), 2);
  const cv::Mat part = wide(cv::Rect(10, 10, 300, 300));
  EXPECT_EQ(BlurOf(part), BlurOf(part.clone()));
}

}  // namespace
}  // namespace viewfix
