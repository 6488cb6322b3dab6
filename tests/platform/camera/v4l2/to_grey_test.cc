// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/v4l2/to_grey.h"

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
  GreyImage grey;
  const Status status = ToGrey({fourcc, width, height, row_bytes, limited, bytes}, 0, grey);
  EXPECT_TRUE(status.ok()) << status.text();
  return grey.pixels;
}

TEST(ToGreyTest, TakesLumaFromWhereItStands) {
  EXPECT_THAT(Convert(V4L2_PIX_FMT_GREY, 2, 2, {1, 2, 3, 4}), ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(Convert(V4L2_PIX_FMT_YUYV, 2, 1, {1, 99, 2, 98}), ElementsAre(1, 2));
  EXPECT_THAT(Convert(V4L2_PIX_FMT_UYVY, 2, 1, {99, 1, 98, 2}), ElementsAre(1, 2));
  EXPECT_THAT(Convert(V4L2_PIX_FMT_NV12, 2, 2, {1, 2, 3, 4, 99, 98}), ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(Convert(V4L2_PIX_FMT_YUV420, 2, 2, {1, 2, 3, 4, 99, 98}), ElementsAre(1, 2, 3, 4));
}

TEST(ToGreyTest, PaddingBetweenRowsIsNoPicture) {
  EXPECT_THAT(Convert(V4L2_PIX_FMT_GREY, 2, 2, {1, 2, 0, 0, 3, 4}, 4), ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(Convert(V4L2_PIX_FMT_YUYV, 2, 2, {1, 9, 2, 9, 0, 0, 3, 9, 4, 9}, 6),
              ElementsAre(1, 2, 3, 4));
}

TEST(ToGreyTest, WeighsRedGreenAndBlue) {
  EXPECT_THAT(Convert(V4L2_PIX_FMT_RGB24, 3, 1, {255, 0, 0, 0, 255, 0, 0, 0, 255}),
              ElementsAre(76, 149, 28));
  EXPECT_THAT(Convert(V4L2_PIX_FMT_BGR24, 3, 1, {255, 0, 0, 0, 255, 0, 0, 0, 255}),
              ElementsAre(28, 149, 76));
  EXPECT_THAT(Convert(V4L2_PIX_FMT_RGB24, 1, 1, {255, 255, 255}), ElementsAre(255));
}

// An even surface has the same value everywhere, whatever the pattern begins with.
TEST(ToGreyTest, BayerIsEvenOnAnEvenSurface) {
  const std::vector<std::uint8_t> bytes = {200, 100, 200, 100, 100, 40, 100, 40,
                                           200, 100, 200, 100, 100, 40, 100, 40};
  for (const std::uint32_t fourcc :
       {V4L2_PIX_FMT_SRGGB8, V4L2_PIX_FMT_SBGGR8, V4L2_PIX_FMT_SGRBG8, V4L2_PIX_FMT_SGBRG8}) {
    EXPECT_THAT(Convert(fourcc, 4, 4, bytes), Each(110));
  }
}

TEST(ToGreyTest, KeepsTheUpperBits) {
  EXPECT_THAT(Convert(V4L2_PIX_FMT_Y16, 2, 1, {0xFF, 0x12, 0x00, 0xFF}), ElementsAre(0x12, 0xFF));
  EXPECT_THAT(Convert(V4L2_PIX_FMT_Y10, 1, 1, {0xFF, 0x03}), ElementsAre(0xFF));
}

TEST(ToGreyTest, LimitedRangeIsStretched) {
  EXPECT_THAT(Convert(V4L2_PIX_FMT_NV12, 2, 2, {16, 235, 0, 255, 1, 1}, 0, true),
              ElementsAre(0, 255, 0, 255));
}

TEST(ToGreyTest, LargeJpegsAreDecodedSmall) {
  constexpr int kWidth = 1280, kHeight = 960;
  const std::vector<std::uint8_t> pixels(std::size_t{kWidth} * kHeight, 90);
  const std::vector<std::uint8_t> jpeg = EncodeJpeg(pixels, kWidth, kHeight, 1);
  for (const auto& [enough, width] : {std::pair(640, 640), {641, 1280}, {300, 320}, {10, 160}}) {
    GreyImage grey;
    ASSERT_TRUE(ToGrey({V4L2_PIX_FMT_MJPEG, kWidth, kHeight, 0, false, jpeg}, enough, grey).ok());
    EXPECT_EQ(grey.width, width);
    EXPECT_EQ(grey.height, width * 3 / 4);
    EXPECT_THAT(grey.pixels, Each(testing::AllOf(testing::Ge(89), testing::Le(91))));
  }
}

TEST(ToGreyTest, ATruncatedJpegIsRefusedAtEveryLength) {
  const std::vector<std::uint8_t> jpeg = EncodeJpeg(MakeTexture(64, 48, 1), 64, 48, 1);
  GreyImage grey;
  for (std::size_t size = 0; size + 2 < jpeg.size(); size += 7) {
    const std::span<const std::uint8_t> part(jpeg.data(), size);
    EXPECT_FALSE(ToGrey({V4L2_PIX_FMT_MJPEG, 64, 48, 0, false, part}, 0, grey).ok()) << size;
    EXPECT_EQ(grey.width, 0);
  }
}

// Any format, size and number of bytes: pixels or an error.
TEST(ToGreyTest, NothingIsReadBeyondTheBytes) {
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
    GreyImage grey;
    const Status enough = ToGrey(raw, 0, grey);
    EXPECT_EQ(enough.ok(), width > 0 && height > 0 && fourcc != V4L2_PIX_FMT_H264);
    if (bytes.empty()) continue;
    bytes.pop_back();
    raw.bytes = bytes;
    EXPECT_FALSE(ToGrey(raw, 0, grey).ok());
  }
}

}  // namespace
}  // namespace viewfix
