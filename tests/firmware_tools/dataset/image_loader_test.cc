// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/dataset/image_loader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "tests/testing/temp_folder.h"

namespace viewfix {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

cv::Mat Picture() {
  cv::Mat image(48, 64, CV_8U, cv::Scalar(200));
  cv::circle(image, {20, 15}, 9, cv::Scalar(30), cv::FILLED);
  cv::putText(image, "A1", {30, 40}, cv::FONT_HERSHEY_SIMPLEX, 0.8, cv::Scalar(90), 2);
  return image;
}

std::string Encoded(const std::string& extension, const cv::Mat& image = Picture()) {
  std::vector<unsigned char> bytes;
  cv::imencode(extension, image, bytes);
  return {bytes.begin(), bytes.end()};
}

// The JPEG with an EXIF block (TIFF, little-endian): orientation, and the focal length on 35 mm
// film in the Exif directory.
std::string WithExif(const std::string& jpeg, char orientation, char focal_35mm) {
  std::string tiff("II*\0\x08\0\0\0", 8);
  tiff += std::string("\x02\0", 2);
  tiff += std::string("\x12\x01\x03\0\x01\0\0\0", 8) + orientation + std::string(3, '\0');
  tiff += std::string("\x69\x87\x04\0\x01\0\0\0\x26\0\0\0", 12) + std::string(4, '\0');
  tiff += std::string("\x01\0", 2);
  tiff += std::string("\x05\xA4\x03\0\x01\0\0\0", 8) + focal_35mm + std::string(7, '\0');
  const std::string body = std::string("Exif\0\0", 6) + tiff;
  std::string head = jpeg.substr(0, 2) + "\xFF\xE1";
  head += static_cast<char>((body.size() + 2) >> 8);
  head += static_cast<char>((body.size() + 2) & 0xFF);
  return head + body + jpeg.substr(2);
}

std::string ErrorOf(const std::filesystem::path& file) {
  try {
    LoadImage(file);
  } catch (const ToolError& error) {
    return error.what();
  }
  return "no error";
}

TEST(LoadImage, LosslessFormatsKeepEveryPixel) {
  const TempFolder folder;
  const cv::Mat picture = Picture();
  for (const char* extension : {".png", ".pgm", ".bmp", ".tiff"}) {
    const YuvImage image =
        LoadImage(folder.Write(std::string("a") + extension, Encoded(extension)));
    ASSERT_EQ(image.width, 64);
    ASSERT_EQ(image.height, 48);
    const std::vector<std::uint8_t> pixels(picture.begin<uchar>(), picture.end<uchar>());
    EXPECT_EQ(image.pixels, pixels) << extension;
  }
}

TEST(LoadImage, JpegHasTheBoardsPixels) {
  const TempFolder folder;
  const std::string bytes = Encoded(".jpg");
  YuvImage board;
  const Status status =
      DecodeJpeg({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, board);
  ASSERT_TRUE(status.ok()) << status.text();
  // The bytes say what a file is, not its name.
  for (const char* name : {"a.jpg", "a.png"}) {
    EXPECT_EQ(LoadImage(folder.Write(name, bytes)).pixels, board.pixels);
  }
}

TEST(LoadImage, ColoursAreThoseOfJpeg) {
  const TempFolder folder;
  const cv::Mat orange(9, 7, CV_8UC3, cv::Scalar(40, 120, 240));
  for (const char* extension : {".png", ".jpg"}) {
    const YuvImage image =
        LoadImage(folder.Write(std::string("a") + extension, Encoded(extension, orange)));
    ASSERT_EQ(image.cb.size(), 4U * 5U) << extension;
    ASSERT_EQ(image.cr.size(), 4U * 5U) << extension;
    for (std::size_t i = 0; i < image.cb.size(); ++i) {
      EXPECT_NEAR(image.cb[i], 68, 2) << extension;
      EXPECT_NEAR(image.cr[i], 194, 2) << extension;
    }
  }
}

TEST(LoadImage, AppliesAndReportsExif) {
  const TempFolder folder;
  ExifInfo exif;
  const YuvImage image = LoadImage(folder.Write("a.jpg", WithExif(Encoded(".jpg"), 6, 28)), &exif);
  EXPECT_EQ(image.width, 48);
  EXPECT_EQ(image.height, 64);
  EXPECT_EQ(exif.orientation, 6);
  ASSERT_TRUE(exif.focal_length_35mm.has_value());
  EXPECT_EQ(*exif.focal_length_35mm, 28);
  LoadImage(folder.Write("b.png", Encoded(".png")), &exif);
  EXPECT_EQ(exif.orientation, 1);
  EXPECT_FALSE(exif.focal_length_35mm.has_value());
}

TEST(LoadImage, NamesFileAndCause) {
  const TempFolder folder;
  const std::string jpeg = Encoded(".jpg");
  const std::string png = Encoded(".png");
  folder.Write("empty.jpg", "");
  folder.Write("text.jpg", "this is not an image\n");
  folder.Write("half.jpg", jpeg.substr(0, jpeg.size() / 2));
  folder.Write("half.png", png.substr(0, png.size() / 2));
  folder.Write("wide.png", Encoded(".png", cv::Mat::zeros(10, 20000, CV_8U)));
  std::filesystem::create_directory(folder / "folder.jpg");
  for (const char* name :
       {"none.jpg", "empty.jpg", "text.jpg", "half.jpg", "half.png", "wide.png", "folder.jpg"}) {
    EXPECT_THAT(ErrorOf(folder / name),
                AllOf(HasSubstr("cannot read image "), HasSubstr(std::string(name) + ": ")));
  }
}

TEST(LoadImage, TakesOnePixel) {
  const TempFolder folder;
  const YuvImage image =
      LoadImage(folder.Write("a.jpg", Encoded(".jpg", cv::Mat(1, 1, CV_8U, cv::Scalar(7)))));
  EXPECT_EQ(image.pixels.size(), 1);
}

TEST(IsImageFileName, KnowsExtensions) {
  EXPECT_TRUE(IsImageFileName("a/b.JPG"));
  EXPECT_TRUE(IsImageFileName("b.jpeg"));
  EXPECT_FALSE(IsImageFileName("images.csv"));
  EXPECT_FALSE(IsImageFileName("jpg"));
}

}  // namespace
}  // namespace viewfix
