// SPDX-License-Identifier: BSD-3-Clause
#include "engine/features/surf.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "engine/features/gaussian.h"
#include "engine/features/haar.h"
#include "engine/features/surf_descriptor.h"
#include "engine/features/surf_orientation.h"
#include "tests/engine/image/test_image.h"

namespace viewfix {
namespace {

constexpr int kCapacity = 200;

FeatureOptions SmallOptions(bool upright = false, int max_features = kCapacity) {
  FeatureOptions options;
  options.max_image_side = 240;
  options.max_features = max_features;
  options.upright = upright;
  return options;
}

FeatureSet Extract(Surf& surf, const TestImage& image, int capacity = kCapacity) {
  FeatureSet features(capacity, kSurfDim);
  EXPECT_TRUE(surf.Extract(image.View(), features).ok());
  return features;
}

FeatureSet Extract(const TestImage& image, bool upright = false) {
  Surf surf(SmallOptions(upright));
  return Extract(surf, image);
}

// Without the grid's choice, which depends on all the image.
FeatureSet ExtractAll(const TestImage& image) {
  Surf surf(SmallOptions(false, 2000));
  return Extract(surf, image, 2000);
}

bool SameFeatures(const FeatureSet& a, const FeatureSet& b) {
  const auto bytes = [](auto span) { return std::as_bytes(span); };
  return a.size() == b.size() &&
         std::ranges::equal(bytes(a.descriptors()), bytes(b.descriptors())) &&
         std::ranges::equal(a.keypoints(), b.keypoints(), [](const Keypoint& p, const Keypoint& q) {
           return p.x == q.x && p.y == q.y && p.sigma == q.sigma && p.cos_angle == q.cos_angle &&
                  p.sin_angle == q.sin_angle && p.response == q.response &&
                  p.laplacian_sign == q.laplacian_sign;
         });
}

int Distance2(std::span<const std::int8_t> a, std::span<const std::int8_t> b) {
  int sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sum;
}

TEST(Surf, SameFeaturesEveryTimeAndFromEveryInstance) {
  const TestImage image = BarsImage(220, 160, 1);
  Surf first(SmallOptions());
  Surf second(SmallOptions());
  const FeatureSet features = Extract(first, image);
  ASSERT_EQ(features.size(), 200);
  EXPECT_TRUE(SameFeatures(features, Extract(second, image)));
  Extract(first, NoiseImage(240, 240, 2));  // leaves nothing behind
  EXPECT_TRUE(SameFeatures(features, Extract(first, image)));
}

TEST(Surf, IgnoresTheBytesBetweenRows) {
  const TestImage image = BarsImage(150, 120, 2);
  TestImage wide(150, 120, 33);
  std::ranges::fill(wide.pixels, 211);
  for (int y = 0; y < 120; ++y) {
    for (int x = 0; x < 150; ++x) wide.At(x, y) = static_cast<std::uint8_t>(image.At(x, y));
  }
  EXPECT_TRUE(SameFeatures(Extract(image), Extract(wide)));
}

TEST(Surf, KeepsToTheMaximum) {
  FeatureOptions options = SmallOptions();
  options.max_features = 16;
  Surf surf(options);
  EXPECT_EQ(Extract(surf, BarsImage(220, 160, 3), 16).size(), 16);
}

TEST(Surf, FindsNothingInTinyOrPlainImages) {
  Surf surf(SmallOptions());
  EXPECT_EQ(Extract(surf, NoiseImage(1, 1, 1)).size(), 0);
  EXPECT_EQ(Extract(surf, NoiseImage(240, 1, 1)).size(), 0);
  EXPECT_EQ(Extract(surf, NoiseImage(1, 240, 1)).size(), 0);
  EXPECT_EQ(Extract(surf, TestImage(200, 200)).size(), 0);
  Extract(surf, NoiseImage(8, 8, 1));  // whatever it finds, within bounds
}

TEST(Surf, KeypointsAndDescriptorsAreSane) {
  const FeatureSet features = Extract(BarsImage(220, 160, 4));
  ASSERT_EQ(features.size(), 200);
  for (int i = 0; i < features.size(); ++i) {
    const Keypoint& k = features.keypoints()[i];
    EXPECT_TRUE(k.x > -1 && k.x < 220 && k.y > -1 && k.y < 160);
    EXPECT_GT(k.sigma, 0.5F);
    EXPECT_GT(k.response, 0);
    EXPECT_NEAR(k.cos_angle * k.cos_angle + k.sin_angle * k.sin_angle, 1, 1e-5);
    double length2 = 0;
    for (const int value : features.descriptor(i)) {
      EXPECT_LT(std::abs(value), 127);  // no clipping
      length2 += value * value;
    }
    EXPECT_NEAR(std::sqrt(length2), 127, 4);
  }
}

TEST(Surf, UprightHasNoOrientation) {
  const FeatureSet features = Extract(BarsImage(220, 160, 5), true);
  ASSERT_GT(features.size(), 0);
  for (const Keypoint& keypoint : features.keypoints()) {
    EXPECT_EQ(keypoint.cos_angle, 1);
    EXPECT_EQ(keypoint.sin_angle, 0);
  }
}

TEST(Surf, OrientationFollowsASlope) {
  for (int angle_deg = 0; angle_deg < 360; angle_deg += 20) {
    const double c = std::cos(angle_deg * M_PI / 180);
    const double s = std::sin(angle_deg * M_PI / 180);
    TestImage image(101, 101);
    for (int y = 0; y < 101; ++y) {
      for (int x = 0; x < 101; ++x) {
        image.At(x, y) = static_cast<std::uint8_t>(std::lround(128 + c * (x - 50) + s * (y - 50)));
      }
    }
    IntegralImage integral(101, FastHessian::kReach);
    integral.Compute(image.View());
    Keypoint keypoint{.x = 50, .y = 50, .sigma = 3};
    AssignOrientation(integral, keypoint);
    EXPECT_GT(keypoint.cos_angle * c + keypoint.sin_angle * s, std::cos(4 * M_PI / 180))
        << angle_deg;
  }
}

TEST(Surf, DescribesAPlainPlaceByZeros) {
  TestImage image(100, 100);
  IntegralImage integral(100, FastHessian::kReach);
  integral.Compute(image.View());
  std::array<std::int8_t, kSurfDim> descriptor;
  descriptor.fill(1);
  DescribeSurf(integral, {.x = 50, .y = 50, .sigma = 2}, descriptor);
  EXPECT_EQ(std::ranges::count(descriptor, 0), kSurfDim);
}

// The image turned by quarters: (x, y) goes to (height - 1 - y, x).
TestImage QuarterTurn(const TestImage& image) {
  TestImage turned(image.height, image.width);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      turned.At(image.height - 1 - y, x) = static_cast<std::uint8_t>(image.At(x, y));
    }
  }
  return turned;
}

struct Survival {
  double found;    // share of points found again
  double matched;  // share of those whose nearest descriptor is the right one
};

// `expected_points`: where, and how large, the points of `before` are to be in `after`.
Survival Compare(const FeatureSet& before, std::span<const Keypoint> expected_points,
                 const FeatureSet& after) {
  int found = 0;
  int matched = 0;
  for (int i = 0; i < before.size(); ++i) {
    const Keypoint& expected = expected_points[i];
    const auto is_at = [&](int j) {
      const Keypoint& k = after.keypoints()[j];
      return std::hypot(k.x - expected.x, k.y - expected.y) < 0.5 + 0.1 * k.sigma &&
             std::fabs(std::log(k.sigma / expected.sigma)) < 0.2;
    };
    bool is_found = false;
    int nearest = 0;
    for (int j = 0; j < after.size(); ++j) {
      is_found |= is_at(j);
      const int distance2 = Distance2(before.descriptor(i), after.descriptor(j));
      if (distance2 < Distance2(before.descriptor(i), after.descriptor(nearest))) nearest = j;
    }
    found += is_found ? 1 : 0;
    matched += is_found && is_at(nearest) ? 1 : 0;
  }
  return {double(found) / before.size(), double(matched) / std::max(1, found)};
}

TEST(Surf, SurvivesQuarterTurns) {
  TestImage image = BarsImage(200, 161, 6);
  const FeatureSet before = ExtractAll(image);
  std::vector<Keypoint> places(before.keypoints().begin(), before.keypoints().end());
  for (int turn = 1; turn <= 3; ++turn) {
    const float height = static_cast<float>(image.height);
    image = QuarterTurn(image);
    for (Keypoint& place : places) {
      const float x = place.x;
      place.x = height - 1 - place.y;
      place.y = x;
    }
    const Survival survival = Compare(before, places, ExtractAll(image));
    EXPECT_GT(survival.found, 0.8) << turn;
    EXPECT_GT(survival.matched, 0.9) << turn;
  }
}

TEST(Surf, ShiftsWithTheImage) {
  const TestImage large = BarsImage(230, 190, 7);
  TestImage left(200, 160);
  TestImage right(200, 160);
  for (int y = 0; y < 160; ++y) {
    for (int x = 0; x < 200; ++x) {
      left.At(x, y) = static_cast<std::uint8_t>(large.At(x, y));
      right.At(x, y) = static_cast<std::uint8_t>(large.At(x + 16, y + 16));
    }
  }
  const FeatureSet before = ExtractAll(right);
  std::vector<Keypoint> expected(before.keypoints().begin(), before.keypoints().end());
  for (Keypoint& keypoint : expected) keypoint.x += 16, keypoint.y += 16;
  const Survival survival = Compare(before, expected, ExtractAll(left));
  EXPECT_GT(survival.found, 0.6);
  EXPECT_GT(survival.matched, 0.9);
}

TEST(Surf, IsIndifferentToContrast) {
  const TestImage image = BarsImage(200, 160, 8);
  TestImage dim = image;
  for (std::uint8_t& pixel : dim.pixels) pixel = static_cast<std::uint8_t>(20 + pixel / 2);
  const FeatureSet before = ExtractAll(image);
  const Survival survival = Compare(before, before.keypoints(), ExtractAll(dim));
  EXPECT_GT(survival.found, 0.95);
  EXPECT_GT(survival.matched, 0.95);
}

std::uint64_t Fnv1a(std::uint64_t hash, std::span<const std::byte> bytes) {
  for (const std::byte byte : bytes) hash = (hash ^ std::uint64_t(byte)) * 0x100000001b3U;
  return hash;
}

// Everything about the features but the padding bytes of Keypoint.
std::uint64_t HashFeatures(const FeatureSet& features) {
  std::uint64_t hash = 0xcbf29ce484222325U;
  for (const Keypoint& k : features.keypoints()) {
    const std::array<float, 6> values = {k.x, k.y, k.sigma, k.cos_angle, k.sin_angle, k.response};
    hash = Fnv1a(hash, std::as_bytes(std::span(values)));
    hash = Fnv1a(hash, std::as_bytes(std::span(&k.laplacian_sign, 1)));
  }
  return Fnv1a(hash, std::as_bytes(features.descriptors()));
}

// Models hold words of these features: if they change, on purpose or by the
// compiler's choice, models no longer fit. On purpose: raise kSurfVersion and put
// the new hashes here.
TEST(Surf, FeaturesChangeOnlyWithTheVersion) {
  EXPECT_EQ(kSurfVersion, 1U);
  const TestImage image = BarsImage(240, 200, 9);
  EXPECT_EQ(HashFeatures(Extract(image)), 528203305209242926U);
  EXPECT_EQ(HashFeatures(Extract(image, true)), 741463409176012047U);
}

// Sizes that no vector divides, and images smaller than one.
TEST(Surf, EveryPathOfTheProcessorGivesTheSameBits) {
  for (const auto& [width, height] : {std::pair(240, 200), {237, 131}, {97, 239}, {9, 7}, {1, 1}}) {
    const TestImage image = BarsImage(width, height, 10);
    for (const bool upright : {false, true}) {
      Surf plain(SmallOptions(upright), CpuPath::kPlain);
      const FeatureSet expected = Extract(plain, image);
      EXPECT_EQ(expected.size() > 50, width > 50);
      for (const CpuPath path : CpuPathsHere()) {
        Surf surf(SmallOptions(upright), path);
        EXPECT_EQ(HashFeatures(Extract(surf, image)), HashFeatures(expected))
            << width << "x" << height << " path " << static_cast<int>(path);
      }
    }
  }
}

}  // namespace
}  // namespace viewfix
