// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/sift_extractor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "firmware_tools/dataset/image_set.h"
#include "tests/engine/image/test_image.h"

namespace viewfix {
namespace {

FeatureOptions SiftOptions() {
  FeatureOptions options;
  options.type = FeatureType::kSift;
  options.max_image_side = 320;
  options.max_features = 100;
  return options;
}

TEST(SiftExtractor, DescribesWithRootsOfUnitSum) {
  const auto sift = CreateSiftExtractor(SiftOptions());
  ASSERT_EQ(sift->descriptor_dim(), 128);
  FeatureSet features(100, 128);
  ASSERT_TRUE(sift->Extract(BarsImage(320, 240, 1, 7).View(), features).ok());
  ASSERT_EQ(features.size(), 100);
  for (int i = 0; i < features.size(); ++i) {
    const Keypoint& k = features.keypoints()[i];
    EXPECT_TRUE(k.x >= 0 && k.x < 320 && k.y >= 0 && k.y < 240);
    EXPECT_GT(k.sigma, 0);
    EXPECT_GT(k.response, 0);
    EXPECT_EQ(k.laplacian_sign, 0);
    EXPECT_NEAR(k.cos_angle * k.cos_angle + k.sin_angle * k.sin_angle, 1, 1e-5);
    double length2 = 0;
    for (const int value : features.descriptor(i)) length2 += value * value;
    EXPECT_NEAR(std::sqrt(length2), 127, 4);
  }
}

TEST(SiftExtractor, GivesTheSameTwice) {
  const auto sift = CreateSiftExtractor(SiftOptions());
  const TestImage image = BarsImage(300, 200, 2);
  FeatureSet first(100, 128);
  FeatureSet second(100, 128);
  ASSERT_TRUE(sift->Extract(image.View(), first).ok());
  ASSERT_TRUE(sift->Extract(image.View(), second).ok());
  EXPECT_TRUE(std::ranges::equal(first.descriptors(), second.descriptors()));
}

TEST(SiftExtractor, UprightHasNoOrientation) {
  FeatureOptions options = SiftOptions();
  options.upright = true;
  FeatureSet features(100, 128);
  ASSERT_TRUE(CreateSiftExtractor(options)->Extract(BarsImage(300, 200, 3).View(), features).ok());
  ASSERT_GT(features.size(), 0);
  for (const Keypoint& k : features.keypoints()) EXPECT_EQ(k.cos_angle, 1);
}

TEST(SiftExtractor, FindsNothingInAPlainImage) {
  FeatureSet features(100, 128);
  const TestImage image(200, 100);
  ASSERT_TRUE(CreateSiftExtractor(SiftOptions())->Extract(image.View(), features).ok());
  EXPECT_EQ(features.size(), 0);
}

TEST(SiftExtractor, RefusesOtherOptionsAndOtherShapes) {
  FeatureOptions surf = SiftOptions();
  surf.type = FeatureType::kSurf;
  EXPECT_THROW(CreateSiftExtractor(surf), ToolError);
  FeatureOptions invalid = SiftOptions();
  invalid.max_features = 1;
  EXPECT_THROW(CreateSiftExtractor(invalid), ToolError);
  FeatureSet features(100, 64);
  EXPECT_EQ(
      CreateSiftExtractor(SiftOptions())->Extract(NoiseImage(9, 9, 1).View(), features).code(),
      StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace viewfix
