// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/v4l2/to_yuv.h"

#include <gmock/gmock.h>
#include <linux/videodev2.h>

#include <random>

#include "tests/testing/jpeg_encoder.h"

namespace viewfix {
namespace {

using testing::Each;
using testing::ElementsAre;

std::vector<std::uint8_t> Convert(std::uint32_t fourcc, int width, int height,
                                  const std::vector<std::uint8_t>& bytes, std::size_t row_bytes = 0,
                                  bool limited = false) {
  YuvImage grey;
  const Status status = ToYuv({fourcc, width, height, row_bytes, limited, bytes}, 0, grey);
  EXPECT_TRUE(status.ok()) << status.text();
  return grey.pixels;
}

TEST(ToYuvTest, TakesLumaFromWhereItStands) {
  EXPECT_THAT(Convert(V4L2_PIX_FMT_GREY, 2, 2, {1, 2, 3, 4}), ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(Convert(V4L2_PIX_FMT_YUYV, 2, 1, {1, 99, 2, 98}), ElementsAre(1, 2));
  EXPECT_THAT(Convert(V4L2_PIX_FMT_UYVY, 2, 1, {99, 1, 98, 2}), ElementsAre(1, 2));
  EXPECT_THAT(Convert(V4L2_PIX_FMT_NV12, 2, 2, {1, 2, 3, 4, 99, 98}), ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(Convert(V4L2_PIX_FMT_YUV420, 2, 2, {1, 2, 3, 4, 99, 98}), ElementsAre(1, 2, 3, 4));
}

TEST(ToYuvTest, PaddingBetweenRowsIsNoPicture) {
  EXPECT_THAT(Convert(V4L2_PIX_FMT_GREY, 2, 2, {1, 2, 0, 0, 3, 4}, 4), ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(Convert(V4L2_PIX_FMT_YUYV, 2, 2, {1, 9, 2, 9, 0, 0, 3, 9, 4, 9}, 6),
              ElementsAre(1, 2, 3, 4));
}

TEST(ToYuvTest, WeighsRedGreenAndBlue) {
  EXPECT_THAT(Convert(V4L2_PIX_FMT_RGB24, 3, 1, {255, 0, 0, 0, 255, 0, 0, 0, 255}),
              ElementsAre(76, 149, 28));
  EXPECT_THAT(Convert(V4L2_PIX_FMT_BGR24, 3, 1, {255, 0, 0, 0, 255, 0, 0, 0, 255}),
              ElementsAre(28, 149, 76));
  EXPECT_THAT(Convert(V4L2_PIX_FMT_RGB24, 1, 1, {255, 255, 255}), ElementsAre(255));
}

// An even surface has the same value everywhere, whatever the pattern begins with.
TEST(ToYuvTest, BayerIsEvenOnAnEvenSurface) {
  const std::vector<std::uint8_t> bytes = {200, 100, 200, 100, 100, 40, 100, 40,
                                           200, 100, 200, 100, 100, 40, 100, 40};
  for (const std::uint32_t fourcc :
       {V4L2_PIX_FMT_SRGGB8, V4L2_PIX_FMT_SBGGR8, V4L2_PIX_FMT_SGRBG8, V4L2_PIX_FMT_SGBRG8}) {
    EXPECT_THAT(Convert(fourcc, 4, 4, bytes), Each(110));
  }
}

TEST(ToYuvTest, KeepsTheUpperBits) {
  EXPECT_THAT(Convert(V4L2_PIX_FMT_Y16, 2, 1, {0xFF, 0x12, 0x00, 0xFF}), ElementsAre(0x12, 0xFF));
  EXPECT_THAT(Convert(V4L2_PIX_FMT_Y10, 1, 1, {0xFF, 0x03}), ElementsAre(0xFF));
}

// Cb and Cr of 4 x 2 pixels: 10 and 20 on the left, 11 and 21 on the right.
TEST(ToYuvTest, TakesChromaFromWhereItStands) {
  const std::uint8_t n = 99;
  const auto chroma = [](std::uint32_t fourcc, std::vector<std::uint8_t> bytes,
                         std::size_t row_bytes = 0) {
    YuvImage grey;
    EXPECT_TRUE(ToYuv({fourcc, 4, 2, row_bytes, false, bytes}, 0, grey).ok());
    std::vector<std::uint8_t> both = grey.cb;
    both.insert(both.end(), grey.cr.begin(), grey.cr.end());
    return both;
  };
  const auto expected = ElementsAre(10, 11, 20, 21);
  const auto twice = [](std::vector<std::uint8_t> row) {
    const auto size = row.size();
    row.resize(2 * size, 77);  // of 4:2:2, the second row is not looked at
    return row;
  };
  EXPECT_THAT(chroma(V4L2_PIX_FMT_YUYV, twice({n, 10, n, 20, n, 11, n, 21})), expected);
  EXPECT_THAT(chroma(V4L2_PIX_FMT_YVYU, twice({n, 20, n, 10, n, 21, n, 11})), expected);
  EXPECT_THAT(chroma(V4L2_PIX_FMT_UYVY, twice({10, n, 20, n, 11, n, 21, n})), expected);
  EXPECT_THAT(chroma(V4L2_PIX_FMT_VYUY, twice({20, n, 10, n, 21, n, 11, n})), expected);
  const std::vector<std::uint8_t> luma(8, n);
  const auto behind = [&](std::vector<std::uint8_t> rest) {
    rest.insert(rest.begin(), luma.begin(), luma.end());
    return rest;
  };
  EXPECT_THAT(chroma(V4L2_PIX_FMT_NV12, behind({10, 20, 11, 21})), expected);
  EXPECT_THAT(chroma(V4L2_PIX_FMT_NV21, behind({20, 10, 21, 11})), expected);
  EXPECT_THAT(chroma(V4L2_PIX_FMT_NV16, behind({10, 20, 11, 21, n, n, n, n})), expected);
  EXPECT_THAT(chroma(V4L2_PIX_FMT_YUV420, behind({10, 11, 20, 21})), expected);
  EXPECT_THAT(chroma(V4L2_PIX_FMT_YVU420, behind({20, 21, 10, 11})), expected);
  EXPECT_THAT(chroma(V4L2_PIX_FMT_YUV422P, behind({10, 11, n, n, 20, 21, n, n})), expected);
  // Rows of six bytes, the last two of them no picture.
  EXPECT_THAT(chroma(V4L2_PIX_FMT_NV12, {n, n, n, n, 0, 0, n, n, n, n, 0, 0, 10, 20, 11, 21}, 6),
              expected);
}

TEST(ToYuvTest, WithoutChromaThereIsNone) {
  YuvImage grey;
  ASSERT_TRUE(
      ToYuv({V4L2_PIX_FMT_YUYV, 2, 1, 0, false, std::vector<std::uint8_t>(4)}, 0, grey).ok());
  EXPECT_FALSE(grey.view().chroma.empty());
  ASSERT_TRUE(
      ToYuv({V4L2_PIX_FMT_GREY, 2, 1, 0, false, std::vector<std::uint8_t>(2)}, 0, grey).ok());
  EXPECT_TRUE(grey.view().chroma.empty());
  // The driver keeps it elsewhere.
  ASSERT_TRUE(
      ToYuv({V4L2_PIX_FMT_NV12, 2, 2, 0, false, std::vector<std::uint8_t>(4)}, 0, grey).ok());
  EXPECT_TRUE(grey.view().chroma.empty());
}

TEST(ToYuvTest, ChromaIsLeftOutWhereItIsNotWanted) {
  YuvImage image;
  image.luma_only = true;
  for (const std::uint32_t fourcc : {V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_NV12, V4L2_PIX_FMT_RGB24}) {
    const std::vector<std::uint8_t> bytes(12, 50);
    ASSERT_TRUE(ToYuv({fourcc, 2, 2, 0, false, bytes}, 0, image).ok());
    EXPECT_TRUE(image.view().chroma.empty());
    EXPECT_EQ(image.pixels[0], 50);
  }
}

TEST(ToYuvTest, RgbHasTheChromaOfJpeg) {
  YuvImage grey;
  const std::vector<std::uint8_t> rgb = {255, 0, 0, 9,  9,  9,  0, 0, 255,
                                         9,   9, 9, 77, 77, 77, 9, 9, 9};
  ASSERT_TRUE(ToYuv({V4L2_PIX_FMT_RGB24, 6, 1, 0, false, rgb}, 0, grey).ok());
  EXPECT_THAT(grey.cb, ElementsAre(85, 255, 128));
  EXPECT_THAT(grey.cr, ElementsAre(255, 107, 128));
}

TEST(ToYuvTest, LimitedRangeIsStretched) {
  EXPECT_THAT(Convert(V4L2_PIX_FMT_NV12, 2, 2, {16, 235, 0, 255, 1, 1}, 0, true),
              ElementsAre(0, 255, 0, 255));
  YuvImage grey;
  const std::vector<std::uint8_t> bytes = {16, 16, 16, 16, 240, 16};
  ASSERT_TRUE(ToYuv({V4L2_PIX_FMT_NV12, 2, 2, 0, true, bytes}, 0, grey).ok());
  EXPECT_THAT(grey.cb, ElementsAre(255));
  EXPECT_THAT(grey.cr, ElementsAre(0));
}

TEST(ToYuvTest, LargeJpegsAreDecodedSmall) {
  constexpr int kWidth = 1280, kHeight = 960;
  const std::vector<std::uint8_t> pixels(std::size_t{kWidth} * kHeight, 90);
  const std::vector<std::uint8_t> jpeg = EncodeJpeg(pixels, kWidth, kHeight, 1);
  for (const auto& [enough, width] : {std::pair(640, 640), {641, 1280}, {300, 320}, {10, 160}}) {
    YuvImage grey;
    ASSERT_TRUE(ToYuv({V4L2_PIX_FMT_MJPEG, kWidth, kHeight, 0, false, jpeg}, enough, grey).ok());
    EXPECT_EQ(grey.width, width);
    EXPECT_EQ(grey.height, width * 3 / 4);
    EXPECT_THAT(grey.pixels, Each(testing::AllOf(testing::Ge(89), testing::Le(91))));
  }
}

TEST(ToYuvTest, ATruncatedJpegIsRefusedAtEveryLength) {
  const std::vector<std::uint8_t> jpeg = EncodeJpeg(MakeTexture(64, 48, 1), 64, 48, 1);
  YuvImage grey;
  for (std::size_t size = 0; size + 2 < jpeg.size(); size += 7) {
    const std::span<const std::uint8_t> part(jpeg.data(), size);
    EXPECT_FALSE(ToYuv({V4L2_PIX_FMT_MJPEG, 64, 48, 0, false, part}, 0, grey).ok()) << size;
    EXPECT_EQ(grey.width, 0);
  }
}

// Any format, size and number of bytes: pixels or an error.
TEST(ToYuvTest, NothingIsReadBeyondTheBytes) {
  std::mt19937 random(1);
  const std::uint32_t formats[] = {V4L2_PIX_FMT_GREY,   V4L2_PIX_FMT_YUYV,   V4L2_PIX_FMT_NV12,
                                   V4L2_PIX_FMT_RGB24,  V4L2_PIX_FMT_SRGGB8, V4L2_PIX_FMT_Y16,
                                   V4L2_PIX_FMT_YUV420, V4L2_PIX_FMT_H264};
  for (int round = 0; round < 2000; ++round) {
    const std::uint32_t fourcc = formats[random() % std::size(formats)];
    const int width = static_cast<int>(random() % 20), height = static_cast<int>(random() % 20);
    RawImage raw = {fourcc, width, height, random() % 64, false, {}};
    // Exactly as many as are needed, on the heap, where the sanitizer sees one too many.
    std::vector<std::uint8_t> bytes(LumaBytes(raw));
    raw.bytes = bytes;
    YuvImage grey;
    const Status enough = ToYuv(raw, 0, grey);
    EXPECT_EQ(enough.ok(), width > 0 && height > 0 && fourcc != V4L2_PIX_FMT_H264);
    if (bytes.empty()) continue;
    for (int more = 0; more < 40; ++more) {  // up to where all chroma is there, and beyond
      std::vector<std::uint8_t> longer(bytes.size() + more);
      raw.bytes = longer;
      EXPECT_EQ(ToYuv(raw, 0, grey).ok(), enough.ok());
    }
    bytes.pop_back();
    raw.bytes = bytes;
    EXPECT_FALSE(ToYuv(raw, 0, grey).ok());
  }
}

}  // namespace
}  // namespace viewfix
