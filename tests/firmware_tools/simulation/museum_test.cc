// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/simulation/museum.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <map>

#include "firmware_tools/dataset/image_loader.h"
#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/mapping/georeference.h"
#include "platform/file.h"
#include "tests/testing/temp_folder.h"

namespace viewfix {
namespace {

SimulateOptions Small(const std::string& out, std::uint64_t seed, int jobs) {
  SimulateOptions options;
  options.out = out;
  options.seed = seed;
  options.images_per_view = 2;
  options.jobs = jobs;
  return options;
}

// Rendered once for all tests of this file: it takes seconds.
class MuseumTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TempFolder;
    SimulateMuseum(Small(*folder_ / "one", 1, 1), {});
    SimulateMuseum(Small(*folder_ / "again", 1, 3), {});
  }
  static void TearDownTestSuite() { delete folder_; }
  static std::vector<std::uint8_t> Bytes(const std::string& name) {
    return *ReadFile(*folder_ / name);
  }

  static TempFolder* folder_;
};

TempFolder* MuseumTest::folder_ = nullptr;

TEST_F(MuseumTest, SameSeedSameBytesOnAnyNumberOfThreads) {
  const ImageSet set = LoadImageSet(*folder_ / "one");
  for (const ImageRecord& image : set.images) {
    ASSERT_EQ(Bytes("one/" + image.path), Bytes("again/" + image.path)) << image.path;
  }
  EXPECT_EQ(Bytes("one/images.csv"), Bytes("again/images.csv"));
}

TEST_F(MuseumTest, TenLocationsOfThreeViews) {
  const ImageSet set = LoadImageSet(*folder_ / "one");
  std::map<std::pair<std::string, std::string>, int> images;
  std::map<std::pair<std::string, std::string>, int> tests;
  for (const ImageRecord& image : set.images) {
    ++images[{image.location, image.view}];
    tests[{image.location, image.view}] += image.is_test ? 1 : 0;
    EXPECT_TRUE(image.pose.has_value());
    EXPECT_TRUE(std::filesystem::exists(set.FullPath(image)));
  }
  EXPECT_EQ(images.size(), 30U);
  for (const auto& [place, count] : images) EXPECT_EQ(count, 2);
  for (const auto& [place, count] : tests) EXPECT_EQ(count, 1);
  ASSERT_EQ(set.cameras.size(), 1U);
  EXPECT_EQ(set.cameras[0].width, 640);
}

TEST_F(MuseumTest, ControlPointsAreTrainingCameras) {
  const ImageSet set = LoadImageSet(*folder_ / "one");
  std::map<std::string, const ImageRecord*> images;
  for (const ImageRecord& image : set.images) images[image.path] = &image;
  const auto controls = ReadControlFile(*folder_ / "one/control.csv");
  EXPECT_EQ(controls.size(), 30U);  // of one training image each
  for (const ControlPoint& control : controls) {
    ASSERT_TRUE(images.contains(control.name));
    const ImageRecord& image = *images[control.name];
    EXPECT_FALSE(image.is_test);
    EXPECT_LT((image.pose->cam_in_world - control.point_in_site).norm(), 1e-3);
  }
}

TEST_F(MuseumTest, ImagesShowSomething) {
  const ImageSet set = LoadImageSet(*folder_ / "one");
  for (const ImageRecord& image : set.images) {
    const YuvImage pixels = LoadImage(set.FullPath(image));
    double sum = 0;
    double sum2 = 0;
    for (const std::uint8_t p : pixels.pixels) sum += p, sum2 += 1.0 * p * p;
    const double n = static_cast<double>(pixels.pixels.size());
    EXPECT_GT(sum2 / n - sum / n * (sum / n), 100) << image.path;
  }
}

TEST_F(MuseumTest, OtherRoomsAreASetOfTheirOwn) {
  const ImageSet others = LoadImageSet(*folder_ / "one/distractors");
  EXPECT_FALSE(others.images.empty());
  for (const ImageRecord& image : others.images) EXPECT_TRUE(image.location.empty());
}

TEST(SimulateMuseum, AFolderThatCannotBeIsAnError) {
  const TempFolder folder;
  try {
    SimulateMuseum(Small(folder / "no/such/place", 1, 1), {});
    FAIL();
  } catch (const ToolError& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("does not exist"));
  }
}

TEST(SimulateMuseum, AnInterruptedRunIsNoSet) {
  const TempFolder folder;
  const Progress stop = [](int, int) { throw ToolError("interrupted"); };
  EXPECT_THROW(SimulateMuseum(Small(folder / "m", 1, 1), stop), ToolError);
  EXPECT_FALSE(std::filesystem::exists(folder / "m/images.csv"));
}

}  // namespace
}  // namespace viewfix
