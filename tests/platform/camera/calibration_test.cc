// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <string>

#include "tests/testing/temp_folder.h"

namespace viewfix {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// As ROS's camera_calibration writes it.
constexpr char kRos[] =
    "image_width: 640\nimage_height: 480\ncamera_name: narrow_stereo  # a comment\n"
    "camera_matrix:\n  rows: 3\n  cols: 3\n"
    "  data: [438.783367, 0.000000, 305.593336, 0.000000, 437.302876,\n"
    "         243.738352, 0.000000, 0.000000, 1.000000]\n"
    "distortion_model: plumb_bob\n"
    "distortion_coefficients:\n  rows: 1\n  cols: 5\n"
    "  data: [-0.361976, 0.110510, 0.001014, 0.000505, 0.000000]\n"
    "rectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n";

// The same in braces and dashes, as others print it.
constexpr char kFlow[] =
    "---\nimage_width: 640\nimage_height: 480\n"
    "camera_matrix: {rows: 3, cols: 3, data: [400, 0, 320, 0, 401, 240, 0, 0, 1]}\n"
    "distortion_model: \"equidistant\"\n"
    "distortion_coefficients:\n  rows: 1\n  cols: 4\n  data:\n  - 0.1\n  - -0.02\n  - 3e-3\n  - "
    "0\n";

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

std::string ErrorOf(std::string_view text) {
  const Result<Camera> camera = ParseCalibration(text);
  if (camera.ok()) return "no error";
  return std::string(camera.status().text()) + " (" + std::string(camera.status().detail()) + ")";
}

TEST(ParseCalibration, ReadsRos) {
  const Result<Camera> camera = ParseCalibration(kRos);
  ASSERT_TRUE(camera.ok()) << ErrorOf(kRos);
  EXPECT_EQ(camera->model, CameraModel::kBrownConrady);
  EXPECT_EQ(camera->width, 640);
  EXPECT_EQ(camera->fx, 438.783367);
  EXPECT_EQ(camera->cy, 243.738352);
  EXPECT_THAT(camera->distortion, ElementsAre(-0.361976, 0.11051, 0.001014, 0.000505, 0, 0, 0, 0));
}

TEST(ParseCalibration, ReadsFisheyeInBracesAndDashes) {
  const Result<Camera> camera = ParseCalibration(kFlow);
  ASSERT_TRUE(camera.ok()) << ErrorOf(kFlow);
  EXPECT_EQ(camera->model, CameraModel::kKannalaBrandt);
  EXPECT_EQ(camera->fy, 401);
  EXPECT_THAT(camera->distortion, ElementsAre(0.1, -0.02, 3e-3, 0, 0, 0, 0, 0));
}

TEST(ParseCalibration, OpenCvFisheyeFlag) {
  const std::string text = Replaced(kFlow, "distortion_model: \"equidistant\"", "fisheye_model: 1");
  EXPECT_EQ(ParseCalibration(text)->model, CameraModel::kKannalaBrandt);
}

TEST(ParseCalibration, RationalModel) {
  std::string text = Replaced(kRos, "plumb_bob", "rational_polynomial");
  text = Replaced(text, "cols: 5", "cols: 8");
  text = Replaced(text, "0.000505, 0.000000]", "0.000505, 5, 6, 7, 8]");
  EXPECT_THAT(ParseCalibration(text)->distortion,
              ElementsAre(-0.361976, 0.11051, 0.001014, 0.000505, 5, 6, 7, 8));
}

TEST(ParseCalibration, NoDistortionIsAPinhole) {
  const std::string all(kRos);
  const auto none = ParseCalibration(all.substr(0, all.find("distortion_model")));
  ASSERT_TRUE(none.ok());
  EXPECT_EQ(none->model, CameraModel::kPinhole);
  const auto zeros = ParseCalibration(
      Replaced(kRos, "-0.361976, 0.110510, 0.001014, 0.000505", "0, 0., -0., 0e3"));
  EXPECT_EQ(zeros->model, CameraModel::kPinhole);
}

TEST(ParseCalibration, NamesWhatIsWrong) {
  const std::tuple<const char*, const char*, const char*> cases[] = {
      {"plumb_bob", "omnidirectional", "distortion_model is not"},
      {"plumb_bob", "equidistant", "a fisheye has 4"},
      {"438.783367", "-438.783367", "focal length is not positive"},
      {"438.783367", "nan", "not finite (camera_matrix)"},
      {"438.783367", "1e999", "not finite (camera_matrix)"},
      {"438.783367", "4x", "not a number (camera_matrix)"},
      {"305.593336, 0.000000", "305.593336, 1", "form"},
      {"1.000000]", "1.000000", "camera_matrix"},
      {"rows: 3", "rows: 30000000", "camera_matrix"},
      {"rows: 3", "rows: 4", "rows and cols"},
      {"image_width: 640", "image_width: 0", "not positive (image_width)"},
      {"image_width: 640", "image_width: 640.5", "image_width"},
      {"image_width: 640", "image_height: 640", "twice (image_height)"},
      {"camera_name: ", "camera_name ", "line 3"},
      {"cols: 5", "cols: 6", "distortion_coefficients"},
  };
  for (const auto& [from, to, cause] : cases) {
    EXPECT_THAT(ErrorOf(Replaced(kRos, from, to)), HasSubstr(cause)) << from << " -> " << to;
  }
  const std::string prism = Replaced(Replaced(kRos, "cols: 5", "cols: 12"), "0.000505, 0.000000]",
                                     "0.000505, 0, 0, 0, 0, 1, 2, 3, 4]");
  EXPECT_THAT(ErrorOf(prism), HasSubstr("thin prism"));
  EXPECT_THAT(ErrorOf(""), HasSubstr("OpenCV"));
  EXPECT_THAT(ErrorOf(std::string_view("a: \0", 4)), HasSubstr("not a text"));
  EXPECT_THAT(ErrorOf("x: 1\na: " + std::string(1000, '{')), HasSubstr("not closed"));
  const std::string deep = "x: 1\na: " + [] {
    std::string text;
    for (int i = 0; i < 50; ++i) text += "{b: ";
    return text + std::string(50, '}');
  }();
  EXPECT_THAT(ErrorOf(deep), HasSubstr("deep"));
}

TEST(ParseCalibration, SurvivesRandomBytes) {
  std::mt19937 random(7);
  const std::string alphabet = "[]{},:- \n\t#!\"'01.eimage_width";
  for (int round = 0; round < 3000; ++round) {
    std::string text = round % 2 == 0 ? kRos : kFlow;
    for (int i = 0; i < 1 + round % 7; ++i) {
      const std::size_t at = random() % text.size();
      if (round % 3 == 0) {
        text.insert(at, 1, alphabet[random() % alphabet.size()]);
      } else {
        text.erase(at, 1 + random() % 20);
      }
    }
    const Result<Camera> camera = ParseCalibration(text);
    if (camera.ok()) {
      EXPECT_GT(camera->fx, 0);
    }
  }
}

TEST(ReadCalibration, NamesTheFile) {
  const TempFolder folder;
  EXPECT_EQ(ReadCalibration(folder.Write("a.yaml", kRos))->height, 480);
  const auto broken = ReadCalibration(folder.Write("b.yaml", "x"));
  EXPECT_THAT(std::string(broken.status().detail()), HasSubstr("b.yaml"));
  EXPECT_EQ(ReadCalibration(folder / "none.yaml").status().code(), StatusCode::kNotFound);
}

}  // namespace
}  // namespace viewfix
