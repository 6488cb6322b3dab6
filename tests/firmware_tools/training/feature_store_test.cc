// SPDX-License-Identifier: BSD-3-Clause
// Features that a folder keeps are those that the photographs would give, or none.
#include "firmware_tools/training/feature_store.h"

#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <numeric>

#include "tests/testing/jpeg_encoder.h"
#include "tests/testing/small_site.h"

namespace viewfix {
namespace {

namespace fs = std::filesystem;

constexpr int kImages = 36;

class KeptFeaturesTest : public ::testing::Test {
 protected:
  FeatureStore Extract(StageCache* cache, const Progress& progress = {}) {
    std::vector<int> all(set_.images.size());
    std::iota(all.begin(), all.end(), 0);
    return ExtractFeatures(set_, all, options_, 2, progress, cache);
  }
  // With the folder as it stands; says how many of the images it knew.
  std::string Report() {
    StageCache cache(Folder());
    ExpectSame(Extract(&cache), Extract(nullptr));
    return cache.Report().at(0);
  }
  static void ExpectSame(const FeatureStore& a, const FeatureStore& b) {
    ASSERT_EQ(a.images.size(), b.images.size());
    EXPECT_EQ(a.failures.size(), b.failures.size());
    for (std::size_t i = 0; i < a.images.size(); ++i) {
      const ImageFeatures &x = a.images[i], &y = b.images[i];
      EXPECT_EQ(x.width, y.width);
      EXPECT_EQ(x.height, y.height);
      EXPECT_EQ(x.exif.orientation, y.exif.orientation);
      EXPECT_EQ(x.exif.focal_length_35mm, y.exif.focal_length_35mm);
      EXPECT_EQ(x.descriptors, y.descriptors);
      ASSERT_EQ(x.keypoints.size(), y.keypoints.size());
      for (std::size_t k = 0; k < x.keypoints.size(); ++k) {
        EXPECT_EQ(Row(x.keypoints[k]), Row(y.keypoints[k]));
      }
    }
  }
  static std::array<float, 7> Row(const Keypoint& k) {
    return {k.x,
            k.y,
            k.sigma,
            k.cos_angle,
            k.sin_angle,
            k.response,
            static_cast<float>(k.laplacian_sign)};
  }
  void WritePhotograph(const std::string& name, std::uint32_t seed) const {
    folder_.Write(name, EncodeJpeg(MakeTexture(160, 120, seed), 160, 120, 1));
  }
  fs::path Folder() const { return folder_ / "stages"; }

  TempFolder folder_;
  ImageSet set_ = LoadImageSet(WriteSmallSite(folder_, "site", 6));
  FeatureOptions options_ = {.max_features = 60};
};

TEST_F(KeptFeaturesTest, ASecondRunTakesThemAll) {
  EXPECT_EQ(Report(), "features (60 an image): 0 of 36 kept");
  EXPECT_EQ(Report(), "features (60 an image): 36 of 36 kept");
}

TEST_F(KeptFeaturesTest, OnlyChangedAndNewFilesAreRead) {
  Report();
  const fs::path site = set_.folder;
  fs::copy_file(site / "bar-left-0.jpg", site / "atrium-left-0.jpg",
                fs::copy_options::overwrite_existing);
  EXPECT_EQ(Report(), "features (60 an image): 36 of 36 kept") << "the contents count";
  WritePhotograph("site/atrium-left-0.jpg", 91);
  EXPECT_EQ(Report(), "features (60 an image): 35 of 36 kept") << "the name does not";
  WritePhotograph("site/another.jpg", 92);
  set_.images.insert(set_.images.begin() + 5, set_.images[0]);
  set_.images[5].path = "another.jpg";
  EXPECT_EQ(Report(), "features (60 an image): 36 of 37 kept");
}

TEST_F(KeptFeaturesTest, OtherOptionsGiveOtherFeatures) {
  Report();
  for (const FeatureOptions& other :
       {FeatureOptions{.max_image_side = 100, .max_features = 60},
        FeatureOptions{.max_features = 60, .upright = true},
        FeatureOptions{.max_features = 60, .threshold = 1e-4F},
        FeatureOptions{.type = FeatureType::kSift, .max_features = 60}}) {
    options_ = other;
    EXPECT_EQ(Report(), "features (60 an image): 0 of 36 kept");
  }
  options_ = {.max_features = 50};
  EXPECT_EQ(Report(), "features (50 an image): 0 of 36 kept");
}

TEST_F(KeptFeaturesTest, DamagedFilesAreComputedAgain) {
  Report();
  int damaged = 0;
  for (const auto& entry : fs::directory_iterator(Folder())) {
    if (damaged++ % 2 == 0) fs::resize_file(entry.path(), fs::file_size(entry.path()) - 1);
  }
  EXPECT_EQ(Report(), "features (60 an image): 18 of 36 kept");
  EXPECT_EQ(Report(), "features (60 an image): 36 of 36 kept");
}

TEST_F(KeptFeaturesTest, ARunThatWasEndedLeavesWhatItHad) {
  StageCache cache(Folder());
  const auto interrupt = [](int done, int /*total*/) {
    if (done == 10) throw ToolError("interrupted");
  };
  EXPECT_THROW(Extract(&cache, interrupt), ToolError);
  StageCache next(Folder());
  ExpectSame(Extract(&next), Extract(nullptr));
  const auto kept = std::distance(fs::directory_iterator(Folder()), fs::directory_iterator());
  EXPECT_EQ(kept, kImages);
  EXPECT_EQ(cache.Report().at(0).substr(0, 28), "features (60 an image): 0 of");
  EXPECT_NE(next.Report().at(0), "features (60 an image): 0 of 36 kept");
}

TEST_F(KeptFeaturesTest, WhatFailsFailsAgain) {
  folder_.Write("site/bar-left-0.jpg", "no photograph");
  EXPECT_EQ(Report(), "features (60 an image): 0 of 36 kept");
  EXPECT_EQ(Report(), "features (60 an image): 35 of 36 kept");
  StageCache cache(Folder());
  EXPECT_EQ(Extract(&cache).failures.size(), 1U);
}

}  // namespace
}  // namespace viewfix
