// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/jpeg_decoder.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <random>
#include <string>

#include "platform/camera/orient.h"
#include "tests/testing/jpeg_encoder.h"

namespace viewfix {
namespace {

using testing::HasSubstr;
using Bytes = std::vector<std::uint8_t>;

constexpr int kWidth = 37;  // no multiple of a block
constexpr int kHeight = 26;

Bytes Texture() { return MakeTexture(kWidth, kHeight, 1); }

Bytes GreyJpeg(const JpegEncoding& encoding = {}) {
  return EncodeJpeg(Texture(), kWidth, kHeight, 1, encoding);
}

Bytes ColourPixels() {
  Bytes rgb;
  std::uint8_t shift = 0;
  for (const std::uint8_t grey : Texture()) {
    rgb.insert(rgb.end(), {grey, static_cast<std::uint8_t>(grey / 2 + shift++ % 16), 90});
  }
  return rgb;
}

int LargestDifference(const Bytes& a, const Bytes& b) {
  int largest = a.size() == b.size() ? 0 : 999;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    largest = std::max(largest, std::abs(a[i] - b[i]));
  }
  return largest;
}

// Where the frame header stands: 4 bytes on the precision, 5 the height, 7 the width.
std::size_t FrameHeaderAt(const Bytes& jpeg) {
  for (std::size_t i = 0; i + 1 < jpeg.size(); ++i) {
    if (jpeg[i] == 0xFF && (jpeg[i + 1] == 0xC0 || jpeg[i + 1] == 0xC2)) return i;
  }
  ADD_FAILURE() << "no frame header";
  return 0;
}

Bytes WithSize(Bytes jpeg, int width, int height) {
  const std::size_t at = FrameHeaderAt(jpeg);
  jpeg[at + 5] = static_cast<std::uint8_t>(height >> 8);
  jpeg[at + 6] = static_cast<std::uint8_t>(height);
  jpeg[at + 7] = static_cast<std::uint8_t>(width >> 8);
  jpeg[at + 8] = static_cast<std::uint8_t>(width);
  return jpeg;
}

TEST(DecodeJpegTest, GivesTheGreyThatWasEncoded) {
  for (const bool progressive : {false, true}) {
    YuvImage image;
    ASSERT_TRUE(DecodeJpeg(GreyJpeg({.quality = 100, .progressive = progressive}), image).ok());
    EXPECT_EQ(image.width, kWidth);
    EXPECT_EQ(image.height, kHeight);
    EXPECT_LE(LargestDifference(image.pixels, Texture()), 2);
  }
}

TEST(DecodeJpegTest, GivesTheLumaOfColours) {
  const Bytes rgb = ColourPixels();
  Bytes luma;
  for (std::size_t i = 0; i < rgb.size(); i += 3) {
    luma.push_back(
        static_cast<std::uint8_t>(0.299 * rgb[i] + 0.587 * rgb[i + 1] + 0.114 * rgb[i + 2] + 0.5));
  }
  YuvImage image;
  ASSERT_TRUE(DecodeJpeg(EncodeJpeg(rgb, kWidth, kHeight, 3, {.quality = 100}), image).ok());
  EXPECT_LE(LargestDifference(image.pixels, luma), 2);
}

TEST(DecodeJpegTest, LeavesChromaOutWhereItIsNotWanted) {
  for (const int orientation : {1, 6}) {
    const Bytes jpeg = EncodeJpeg(ColourPixels(), kWidth, kHeight, 3,
                                  {.app1 = MakeExif(orientation, 0, false)});
    YuvImage whole, luma;
    luma.luma_only = true;
    ASSERT_TRUE(DecodeJpeg(jpeg, whole).ok());
    ASSERT_TRUE(DecodeJpeg(jpeg, luma).ok());
    EXPECT_FALSE(whole.view().chroma.empty());
    EXPECT_TRUE(luma.view().chroma.empty());
    EXPECT_EQ(luma.pixels, whole.pixels);
    ASSERT_TRUE(DecodeJpegReduced(jpeg, 1000, luma).ok());
    EXPECT_TRUE(luma.view().chroma.empty());
    luma.luma_only = false;
    ASSERT_TRUE(DecodeJpeg(jpeg, luma).ok());
    EXPECT_EQ(luma.cb, whole.cb);
  }
}

TEST(DecodeJpegTest, ProgressiveAndRestartMarksDoNotChangeThePixels) {
  YuvImage baseline;
  YuvImage other;
  ASSERT_TRUE(DecodeJpeg(GreyJpeg(), baseline).ok());
  ASSERT_TRUE(DecodeJpeg(GreyJpeg({.progressive = true}), other).ok());
  EXPECT_EQ(other.pixels, baseline.pixels);
  ASSERT_TRUE(DecodeJpeg(GreyJpeg({.restart_rows = 1}), other).ok());
  EXPECT_EQ(other.pixels, baseline.pixels);
}

TEST(DecodeJpegTest, KeepsItsMemoryBetweenFrames) {
  YuvImage image;
  ASSERT_TRUE(DecodeJpeg(GreyJpeg(), image).ok());
  const std::uint8_t* const before = image.pixels.data();
  ASSERT_TRUE(DecodeJpeg(GreyJpeg({.quality = 30}), image).ok());
  EXPECT_EQ(image.pixels.data(), before);
}

TEST(DecodeJpegTest, OnePixel) {
  const Bytes pixel = {77};
  YuvImage image;
  ASSERT_TRUE(DecodeJpeg(EncodeJpeg(pixel, 1, 1, 1), image).ok());
  EXPECT_EQ(image.width, 1);
  EXPECT_EQ(image.height, 1);
  EXPECT_NEAR(image.pixels[0], 77, 2);
}

TEST(DecodeJpegTest, AllOrientations) {
  YuvImage stored;
  ASSERT_TRUE(DecodeJpeg(GreyJpeg(), stored).ok());
  for (int orientation = 1; orientation <= 8; ++orientation) {
    for (const bool big_endian : {false, true}) {
      YuvImage expected;
      Orient(stored, orientation, expected);
      YuvImage image;
      ExifInfo exif;
      const Bytes jpeg = GreyJpeg({.app1 = MakeExif(orientation, 26, big_endian)});
      ASSERT_TRUE(DecodeJpeg(jpeg, image, &exif).ok());
      EXPECT_EQ(exif.orientation, orientation);
      EXPECT_EQ(exif.focal_length_35mm, 26.0);
      EXPECT_EQ(image.width, expected.width);
      EXPECT_EQ(image.height, expected.height);
      EXPECT_EQ(image.pixels, expected.pixels);
    }
  }
}

TEST(DecodeJpegTest, WhatExifDoesNotSayIsNotInvented) {
  for (const Bytes& app1 : {Bytes(), MakeExif(0, 0, false), MakeExif(9, 0, true),
                            Bytes{'E', 'x', 'i', 'f', 0, 0}, Bytes{'h', 't', 't', 'p', ':'}}) {
    YuvImage image;
    ExifInfo exif = {.orientation = 5, .focal_length_35mm = 1.0};
    ASSERT_TRUE(DecodeJpeg(GreyJpeg({.app1 = app1}), image, &exif).ok());
    EXPECT_EQ(exif.orientation, 1);
    EXPECT_FALSE(exif.focal_length_35mm.has_value());
  }
}

TEST(DecodeJpegTest, HostileExifNeverFailsTheDecode) {
  std::mt19937 random(7);
  const Bytes honest = MakeExif(6, 26, true);
  for (int round = 0; round < 500; ++round) {
    Bytes app1 = honest;
    if (round % 2 == 0) app1.resize(7 + random() % 200);
    for (unsigned changes = 1 + random() % 8; changes > 0; --changes) {
      app1[6 + random() % (app1.size() - 6)] = static_cast<std::uint8_t>(random());
    }
    YuvImage image;
    ASSERT_TRUE(DecodeJpeg(GreyJpeg({.app1 = app1}), image).ok()) << round;
    ASSERT_EQ(image.pixels.size(), std::size_t{kWidth} * kHeight);
  }
}

TEST(DecodeJpegTest, EveryTruncationIsRefused) {
  for (const bool progressive : {false, true}) {
    const Bytes jpeg = EncodeJpeg(ColourPixels(), kWidth, kHeight, 3, {.progressive = progressive});
    YuvImage image;
    ASSERT_TRUE(DecodeJpeg(jpeg, image).ok());
    for (std::size_t size = 0; size < jpeg.size(); ++size) {
      const Status status = DecodeJpeg(std::span(jpeg).first(size), image);
      ASSERT_EQ(status.code(), StatusCode::kCorrupt) << size << " of " << jpeg.size();
      ASSERT_TRUE(image.view().empty());
    }
  }
}

TEST(DecodeJpegTest, TruncationIsNamed) {
  const Bytes jpeg = GreyJpeg();
  YuvImage image;
  const Status status = DecodeJpeg(std::span(jpeg).first(jpeg.size() * 2 / 3), image);
  EXPECT_STREQ(status.text(), "damaged JPEG");
  EXPECT_EQ(status.detail(), "Premature end of JPEG file");
}

TEST(DecodeJpegTest, BytesAfterTheEndAreIgnored) {
  Bytes jpeg = GreyJpeg();
  jpeg.insert(jpeg.end(), 100, 0xFF);
  YuvImage image;
  EXPECT_TRUE(DecodeJpeg(jpeg, image).ok());
}

TEST(DecodeJpegTest, FlippedBitsNeverCrash) {
  std::mt19937 random(3);
  for (const bool progressive : {false, true}) {
    const Bytes jpeg = EncodeJpeg(ColourPixels(), kWidth, kHeight, 3,
                                  {.progressive = progressive, .app1 = MakeExif(6, 26, false)});
    for (int round = 0; round < 1000; ++round) {
      Bytes damaged = jpeg;
      for (unsigned flips = 1 + random() % 4; flips > 0; --flips) {
        damaged[random() % damaged.size()] ^= static_cast<std::uint8_t>(1U << random() % 8);
      }
      YuvImage image;
      if (DecodeJpeg(damaged, image).ok()) {
        ASSERT_EQ(image.pixels.size(), std::size_t(image.width) * image.height);
      } else {
        ASSERT_TRUE(image.view().empty());
      }
    }
  }
}

TEST(DecodeJpegTest, WhatIsNoJpegIsCalledSo) {
  const std::string text = "\x89PNG, say";
  for (const std::string& content : {text, std::string()}) {
    YuvImage image;
    const Status status =
        DecodeJpeg({reinterpret_cast<const std::uint8_t*>(content.data()), content.size()}, image);
    EXPECT_EQ(status.code(), StatusCode::kCorrupt);
    EXPECT_STREQ(status.text(), "not a JPEG");
  }
}

TEST(DecodeJpegTest, RefusesSizesBeforeAllocating) {
  for (const auto& [width, height] : {std::pair(20000, 10), {10, 20000}, {16384, 1025}}) {
    YuvImage image;
    const Status status = DecodeJpeg(WithSize(GreyJpeg(), width, height), image);
    EXPECT_EQ(status.code(), StatusCode::kUnsupported) << width << "x" << height;
    EXPECT_EQ(image.pixels.capacity(), 0U);
  }
  YuvImage image;
  EXPECT_EQ(DecodeJpeg(WithSize(GreyJpeg(), 0, 10), image).code(), StatusCode::kCorrupt);
}

TEST(DecodeJpegTest, RefusesWhatItCannotTurnIntoLuma) {
  YuvImage image;
  const Bytes cmyk(16 * 16 * 4, 100);
  EXPECT_EQ(DecodeJpeg(EncodeJpeg(cmyk, 16, 16, 4), image).code(), StatusCode::kUnsupported);
  Bytes twelve_bits = GreyJpeg();
  twelve_bits[FrameHeaderAt(twelve_bits) + 4] = 12;
  EXPECT_EQ(DecodeJpeg(twelve_bits, image).code(), StatusCode::kUnsupported);
}

TEST(DecodeJpegTest, RefusesEndlessScans) {
  YuvImage image;
  const Status status = DecodeJpeg(GreyJpeg({.one_scan_per_coefficient = true}), image);
  EXPECT_EQ(status.code(), StatusCode::kUnsupported);
  EXPECT_STREQ(status.text(), "JPEG has too many scans");
}

}  // namespace
}  // namespace viewfix
