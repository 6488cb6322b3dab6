// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/map_input.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace viewfix {
namespace {

using ::testing::HasSubstr;

// One image found in 640 x 480 pixels, of a camera as the test says.
class MapInputTest : public ::testing::Test {
 protected:
  MapInputTest() {
    set_.images.emplace_back().path = "a.jpg";
    ImageFeatures& found = features_.images.emplace_back();
    found.width = 640;
    found.height = 480;
    found.keypoints.resize(1);
  }

  MapInput Make() const {
    const int first = 0;
    return MakeMapInput(set_, features_, std::span(&first, 1));
  }

  ImageSet set_;
  FeatureStore features_;
};

TEST_F(MapInputTest, TheSetsCameraIsResized) {
  set_.cameras.push_back({1280, 960, 1000, 1010, 639.5, 479.5, {}, CameraModel::kPinhole});
  set_.images[0].camera_idx = 0;
  features_.images[0].exif.focal_length_35mm = 50;
  const MapInput input = Make();
  EXPECT_FALSE(input.focal_is_guess);
  EXPECT_TRUE(input.warnings.empty());
  EXPECT_EQ(input.cameras[0].width, 640);
  EXPECT_NEAR(input.cameras[0].fx, 500, 1e-9);
  EXPECT_NEAR(input.cameras[0].cx, 319.5, 1e-9);
}

TEST_F(MapInputTest, ExifIsTheFirstGuess) {
  features_.images[0].exif.focal_length_35mm = 27;
  const MapInput input = Make();
  EXPECT_TRUE(input.focal_is_guess);
  EXPECT_NEAR(input.cameras[0].fx, 480, 1e-9);
  EXPECT_THAT(input.warnings.at(0), HasSubstr("1 image without a calibration: EXIF"));
}

TEST_F(MapInputTest, TimesAreTheNumbersInNames) {
  set_.images[0].path = "walk/00010.jpg";
  for (const char* path : {"walk/00013.jpg", "walk/00016.jpg", "walk/00022.jpg"}) {
    set_.images.push_back(set_.images[0]);
    set_.images.back().path = path;
    features_.images.push_back(features_.images[0]);
  }
  const std::vector<int> used = {0, 1, 3};  // the third is left out, and counts
  const MapInput input = MakeMapInput(set_, features_, used);
  EXPECT_NEAR(input.frames[1].time - input.frames[0].time, 1, 1e-12);
  EXPECT_NEAR(input.frames[2].time - input.frames[1].time, 3, 1e-12);
}

TEST_F(MapInputTest, TimesAreTheOrderWhereNumbersDoNotAscend) {
  for (const char* path : {"b3.jpg", "b2.jpg"}) {
    set_.images.push_back(set_.images[0]);
    set_.images.back().path = path;
    features_.images.push_back(features_.images[0]);
  }
  const std::vector<int> used = {0, 2};
  const MapInput input = MakeMapInput(set_, features_, used);
  EXPECT_EQ(input.frames[1].time - input.frames[0].time, 2);
}

TEST_F(MapInputTest, TheLastGuessIsSaid) {
  const MapInput input = Make();
  EXPECT_TRUE(input.focal_is_guess);
  EXPECT_NEAR(input.cameras[0].fx, 1.2 * 640, 1e-9);
  EXPECT_TRUE(input.cameras[0].Validate().ok());
  EXPECT_THAT(input.warnings.at(0), HasSubstr("guessed"));
}

}  // namespace
}  // namespace viewfix
