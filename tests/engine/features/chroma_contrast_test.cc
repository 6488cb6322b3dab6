// SPDX-License-Identifier: BSD-3-Clause
#include "engine/features/chroma_contrast.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <vector>

#include "engine/features/surf.h"
#include "engine/features/surf_descriptor.h"
#include "tests/engine/image/test_image.h"

namespace viewfix {
namespace {

constexpr int kSide = 200;
using Numbers = std::array<std::int8_t, kChromaDim>;

// An image of kSide, evenly grey if no other is given, with chroma of a given resolution, Cb as a
// function of the place in the image (pixels) and Cr one of its own.
class Colours {
 public:
  using Value = std::function<int(double x, double y)>;

  Colours(int chroma_side, const Value& cb, const Value& cr, const TestImage& grey = EvenGrey())
      : grey_(grey), cb_(chroma_side, chroma_side, 3), cr_(chroma_side, chroma_side, 3) {
    const double scale = double{kSide} / chroma_side;
    for (int y = 0; y < chroma_side; ++y) {
      for (int x = 0; x < chroma_side; ++x) {
        const double image_x = (x + 0.5) * scale - 0.5, image_y = (y + 0.5) * scale - 0.5;
        cb_.At(x, y) = static_cast<std::uint8_t>(cb(image_x, image_y));
        cr_.At(x, y) = static_cast<std::uint8_t>(cr(image_x, image_y));
      }
    }
  }

  ImageView View() const {
    ImageView view = grey_.View();
    view.chroma = {cb_.pixels.data(), cr_.pixels.data(), cb_.width, cb_.height, cb_.row_bytes};
    return view;
  }

  Numbers At(const Keypoint& keypoint) const {
    ChromaContrast contrast(kSide);
    IntegralImage luma(kSide, 0);
    luma.Compute(grey_.View());
    contrast.Start(View(), luma);
    Numbers numbers;
    contrast.Describe(keypoint, numbers);
    return numbers;
  }

 private:
  static TestImage EvenGrey() {
    TestImage grey(kSide, kSide);
    std::fill(grey.pixels.begin(), grey.pixels.end(), std::uint8_t{110});
    return grey;
  }

  TestImage grey_;
  TestImage cb_;
  TestImage cr_;
};

Colours::Value Even(int value) {
  return [value](double, double) { return value; };
}

Keypoint Middle() { return {.x = 99.5F, .y = 99.5F, .sigma = 5}; }

TEST(ChromaContrast, WithoutColoursThereAreNoContrasts) {
  ChromaContrast contrast(kSide);
  Numbers numbers;
  numbers.fill(9);
  const TestImage bars = BarsImage(kSide, kSide, 1);
  IntegralImage luma(kSide, 0);
  luma.Compute(bars.View());
  contrast.Start(bars.View(), luma);
  contrast.Describe(Middle(), numbers);
  EXPECT_EQ(numbers, Numbers{});
  EXPECT_EQ(Colours(100, Even(90), Even(200)).At(Middle()), Numbers{});
}

TEST(ChromaContrast, SaysWhichHalfHasMore) {
  const auto step = [](double x, double) { return x < 99.5 ? 120 : 126; };
  EXPECT_EQ(Colours(100, step, Even(128)).At(Middle()), (Numbers{0, 30, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(Colours(100, Even(128), step).At(Middle()), (Numbers{0, 0, 0, 0, 0, 30, 0, 0}));
  const auto below = [&](double x, double y) { return step(y, x); };
  EXPECT_EQ(Colours(100, below, Even(128)).At(Middle()), (Numbers{30, 0, 0, 0, 0, 0, 0, 0}));
  const auto quarters = [](double x, double y) { return (x < 99.5) == (y < 99.5) ? 126 : 120; };
  EXPECT_EQ(Colours(100, quarters, Even(128)).At(Middle()), (Numbers{0, 0, 30, 0, 0, 0, 0, 0}));
}

TEST(ChromaContrast, SaysHowTheMiddleDiffers) {
  // 40 x 40 of the 80 x 80 that are looked at.
  const auto blob = [](double x, double y) {
    return std::abs(x - 99.5) < 20 && std::abs(y - 99.5) < 20 ? 108 : 100;
  };
  EXPECT_EQ(Colours(100, blob, Even(128)).At(Middle()), (Numbers{0, 0, 0, 42, 0, 0, 0, 0}));
}

// Four tiles of different colours, seen with different gains of red and blue.
TEST(ChromaContrast, GainsOfRedAndBlueMoveLittle) {
  const auto numbers_with = [](double red_gain, double blue_gain) {
    const auto rgb = [=](double x, double y) {
      const bool right = x > 99, lower = y > 95;
      const double r = right ? 150 : 90, g = lower ? 120 : 60, b = right == lower ? 110 : 50;
      return std::array<double, 3>{r * red_gain, g, b * blue_gain};
    };
    const auto luma = [](const std::array<double, 3>& c) {
      return 0.299 * c[0] + 0.587 * c[1] + 0.114 * c[2];
    };
    TestImage grey(kSide, kSide);
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) grey.At(x, y) = std::uint8_t(luma(rgb(x, y)));
    }
    const auto chroma = [=](int channel, double factor) {
      return [=](double x, double y) {
        const auto c = rgb(x, y);
        return static_cast<int>(std::lround(128 + factor * (c[channel] - luma(c))));
      };
    };
    return Colours(100, chroma(2, 0.564), chroma(0, 0.713), grey).At(Middle());
  };
  const Numbers even = numbers_with(1, 1);
  const Numbers warm = numbers_with(1.15, 0.87);
  for (int i = 0; i < kChromaDim; ++i) {
    EXPECT_NEAR(warm[i], even[i], 4 + 0.2 * std::abs(even[i])) << i;
  }
  EXPECT_GT(*std::ranges::max_element(even), 40);
}

TEST(ChromaContrast, ACastOnEvenGreyMovesNothing) {
  for (const int cast : {-20, -3, 4, 25}) {
    const auto wave = [&](int less) {
      return [=](double x, double y) { return 128 + (int(x * 7 + y * 3) % 17) - less; };
    };
    const Keypoint keypoint = {
        .x = 60, .y = 81, .sigma = 3.3F, .cos_angle = 0.6F, .sin_angle = 0.8F};
    EXPECT_EQ(Colours(100, wave(0), wave(0)).At(keypoint),
              Colours(100, wave(-cast), wave(cast)).At(keypoint));
  }
}

TEST(ChromaContrast, TurnsWithTheKeyPoint) {
  const auto step = [](double x, double) { return x < 99.5 ? 120 : 126; };
  const Colours colours(100, step, Even(128));
  Keypoint turned = Middle();  // its own x axis points down the image
  turned.cos_angle = 0;
  turned.sin_angle = 1;
  EXPECT_EQ(colours.At(turned), (Numbers{-30, 0, 0, 0, 0, 0, 0, 0}));
}

// Cameras keep chroma in full, in half or in less resolution.
TEST(ChromaContrast, ResolutionHardlyMatters) {
  const auto waves = [](double x, double y) {
    return 128 + static_cast<int>(30 * std::sin(x / 17) * std::cos(y / 23));
  };
  const Keypoint keypoint = {.x = 70, .y = 120, .sigma = 4, .cos_angle = 0.6F, .sin_angle = -0.8F};
  const Numbers half = Colours(100, waves, waves).At(keypoint);
  EXPECT_NE(half, Numbers{});
  for (const int side : {50, 200}) {
    const Numbers other = Colours(side, waves, waves).At(keypoint);
    for (int i = 0; i < kChromaDim; ++i) EXPECT_NEAR(other[i], half[i], 12) << side << " " << i;
  }
}

TEST(ChromaContrast, AnyPlaceAndScaleIsDescribed) {
  const Colours colours(
      7, [](double x, double) { return x < 100 ? 0 : 255; }, Even(1));
  for (const float place : {-300.0F, 0.0F, 199.0F, 900.0F}) {
    for (const float sigma : {0.01F, 1.6F, 300.0F}) {
      const Numbers numbers = colours.At({.x = place, .y = place, .sigma = sigma});
      EXPECT_EQ(numbers[0], 0);
    }
  }
}

TEST(ColorSurf, IsSurfAndContrasts) {
  FeatureOptions options;
  options.max_image_side = 240;
  options.max_features = 200;
  Surf grey(options);
  options.type = FeatureType::kColorSurf;
  Surf colour(options);
  EXPECT_EQ(colour.descriptor_dim(), kSurfDim + kChromaDim);
  const Colours colours(
      100, [](double x, double y) { return int(x + y) % 256; },
      [](double x, double) { return int(x); }, BarsImage(kSide, kSide, 1));
  FeatureSet of_grey(200, kSurfDim), of_colour(200, kSurfDim + kChromaDim);
  ASSERT_TRUE(grey.Extract(colours.View(), of_grey).ok());
  ASSERT_TRUE(colour.Extract(colours.View(), of_colour).ok());
  ASSERT_EQ(of_colour.size(), of_grey.size());
  ASSERT_GT(of_grey.size(), 20);
  for (int i = 0; i < of_grey.size(); ++i) {
    const auto descriptor = of_colour.descriptor(i);
    EXPECT_TRUE(std::ranges::equal(descriptor.first(kSurfDim), of_grey.descriptor(i)));
    const Numbers expected = colours.At(of_colour.keypoints()[i]);
    EXPECT_TRUE(std::ranges::equal(descriptor.last(kChromaDim), expected));
  }
}

TEST(SurfChroma, IsSurfWithTheContrastsBesideIt) {
  FeatureOptions options;
  options.max_image_side = 240;
  options.max_features = 200;
  Surf grey(options);
  options.type = FeatureType::kSurfChroma;
  Surf colour(options);
  ASSERT_EQ(colour.descriptor_dim(), kSurfDim);
  const Colours colours(
      100, [](double x, double y) { return int(x + y) % 256; },
      [](double x, double) { return int(x); }, BarsImage(kSide, kSide, 1));
  FeatureSet of_grey(200, kSurfDim), of_colour(200, kSurfDim);
  ASSERT_TRUE(grey.Extract(colours.View(), of_grey).ok());
  ASSERT_TRUE(colour.Extract(colours.View(), of_colour).ok());
  ASSERT_GT(of_colour.size(), 20);
  EXPECT_TRUE(std::ranges::equal(of_colour.descriptors(), of_grey.descriptors()));
  EXPECT_FALSE(of_grey.has_chroma());
  ASSERT_TRUE(of_colour.has_chroma());
  for (int i = 0; i < of_colour.size(); ++i) {
    const auto chroma = of_colour.chroma().subspan(std::size_t(i) * kChromaDim, kChromaDim);
    EXPECT_TRUE(std::ranges::equal(chroma, colours.At(of_colour.keypoints()[i])));
  }
  ImageView without = colours.View();
  without.chroma = {};
  ASSERT_TRUE(colour.Extract(without, of_colour).ok());
  EXPECT_FALSE(of_colour.has_chroma());
}

TEST(SurfChroma, AGreyPictureInAColourFormatHasNoColours) {
  FeatureOptions options;
  options.type = FeatureType::kSurfChroma;
  options.max_image_side = 240;
  options.max_features = 200;
  Surf surf(options);
  const Colours colours(
      100, [](double, double) { return 128; }, [](double x, double) { return 128 + int(x) % 2; },
      BarsImage(kSide, kSide, 1));
  FeatureSet features(200, kSurfDim);
  ASSERT_TRUE(surf.Extract(colours.View(), features).ok());
  ASSERT_GT(features.size(), 20);
  EXPECT_FALSE(features.has_chroma());
}

}  // namespace
}  // namespace viewfix
