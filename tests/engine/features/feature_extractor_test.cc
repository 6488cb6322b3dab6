// SPDX-License-Identifier: BSD-3-Clause
#include "engine/features/feature_extractor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/engine/image/test_image.h"

namespace viewfix {
namespace {

TEST(FeatureOptions, DefaultsAreValid) { EXPECT_TRUE(FeatureOptions().Validate().ok()); }

TEST(FeatureOptions, RefusesEachFieldOutsideItsRange) {
  const auto refuses = [](auto change) {
    FeatureOptions options;
    change(options);
    return options.Validate().code() == StatusCode::kInvalidArgument;
  };
  EXPECT_TRUE(refuses([](auto& o) { o.type = FeatureType(0); }));
  EXPECT_TRUE(refuses([](auto& o) { o.type = FeatureType(5); }));
  EXPECT_TRUE(refuses([](auto& o) { o.max_image_side = 63; }));
  EXPECT_TRUE(refuses([](auto& o) { o.max_image_side = 4097; }));
  EXPECT_TRUE(refuses([](auto& o) { o.max_features = 15; }));
  EXPECT_TRUE(refuses([](auto& o) { o.max_features = 8193; }));
  EXPECT_TRUE(refuses([](auto& o) { o.threshold = -1e-9F; }));
  EXPECT_TRUE(refuses([](auto& o) { o.threshold = 2; }));
  EXPECT_TRUE(refuses([](auto& o) { o.threshold = std::nanf(""); }));
}

TEST(CreateFeatureExtractor, RefusesInvalidOptions) {
  FeatureOptions options;
  options.max_features = 0;
  EXPECT_EQ(CreateFeatureExtractor(options).status().code(), StatusCode::kInvalidArgument);
}

TEST(CreateFeatureExtractor, LeavesSiftToTheLaptop) {
  FeatureOptions options;
  options.type = FeatureType::kSift;
  EXPECT_EQ(CreateFeatureExtractor(options).status().code(), StatusCode::kUnsupported);
}

#ifdef VIEWFIX_HAVE_SURF

TEST(FeatureExtractor, RefusesWhatItCannotTake) {
  FeatureOptions options;
  options.max_image_side = 100;
  options.max_features = 20;
  const auto extractor = CreateFeatureExtractor(options);
  ASSERT_TRUE(extractor.ok());
  FeatureSet features(20, 64);
  const auto code = [&](const ImageView& image, FeatureSet& set) {
    return (*extractor)->Extract(image, set).code();
  };
  const TestImage image = NoiseImage(100, 100, 1);
  EXPECT_EQ(code(image.View(), features), StatusCode::kOk);
  EXPECT_EQ(code({}, features), StatusCode::kInvalidArgument);
  EXPECT_EQ(code({image.pixels.data(), 0, 10, 10}, features), StatusCode::kInvalidArgument);
  EXPECT_EQ(code({image.pixels.data(), 10, -1, 10}, features), StatusCode::kInvalidArgument);
  EXPECT_EQ(code({image.pixels.data(), 10, 10, 9}, features), StatusCode::kInvalidArgument);
  EXPECT_EQ(code({image.pixels.data(), 101, 2, 101}, features), StatusCode::kInvalidArgument);
  EXPECT_EQ(code(NoiseImage(20000, 10, 2).View(), features), StatusCode::kInvalidArgument);
  FeatureSet wrong_dim(20, 128);
  EXPECT_EQ(code(image.View(), wrong_dim), StatusCode::kInvalidArgument);
  FeatureSet too_small(19, 64);
  EXPECT_EQ(code(image.View(), too_small), StatusCode::kInvalidArgument);
}

#else

TEST(CreateFeatureExtractor, SaysThatThisBuildHasNoSurf) {
  EXPECT_EQ(CreateFeatureExtractor({}).status().code(), StatusCode::kUnsupported);
}

#endif

}  // namespace
}  // namespace viewfix
