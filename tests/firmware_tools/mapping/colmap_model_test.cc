// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/colmap_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <random>
#include <string>

#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/dataset/tool_file.h"
#include "firmware_tools/mapping/colmap_convention.h"
#include "tests/firmware_tools/mapping/synthetic_map.h"
#include "tests/testing/run_program.h"
#include "tests/testing/temp_folder.h"

namespace viewfix {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double kRounding = 1e-11;

void ExpectSame(const Reconstruction& a, const Reconstruction& b) {
  ASSERT_EQ(a.cameras.size(), b.cameras.size());
  for (std::size_t i = 0; i < a.cameras.size(); ++i) EXPECT_EQ(a.cameras[i], b.cameras[i]);
  ASSERT_EQ(a.images.size(), b.images.size());
  for (std::size_t i = 0; i < a.images.size(); ++i) {
    const MapImage& x = a.images[i];
    const MapImage& y = b.images[i];
    EXPECT_EQ(x.name, y.name);
    EXPECT_EQ(x.camera_idx, y.camera_idx);
    EXPECT_EQ(x.point_idx, y.point_idx);
    EXPECT_TRUE(x.cam_from_world.rotation.isApprox(y.cam_from_world.rotation, kRounding));
    EXPECT_TRUE(x.cam_from_world.translation.isApprox(y.cam_from_world.translation, kRounding));
    ASSERT_EQ(x.keypoints.size(), y.keypoints.size());
    for (std::size_t k = 0; k < x.keypoints.size(); ++k) {
      EXPECT_TRUE(x.keypoints[k].isApprox(y.keypoints[k], kRounding));
    }
  }
  ASSERT_EQ(a.points.size(), b.points.size());
  for (std::size_t i = 0; i < a.points.size(); ++i) {
    EXPECT_TRUE(a.points[i].position.isApprox(b.points[i].position, kRounding));
    EXPECT_EQ(a.points[i].track, b.points[i].track);
  }
}

std::string ErrorOf(const std::filesystem::path& folder) {
  try {
    ReadColmapModel(folder);
  } catch (const ToolError& error) {
    return error.what();
  }
  return "no error";
}

TEST(ColmapConvention, PixelCentres) {
  EXPECT_EQ(ToColmapPixel({0, 0}), Eigen::Vector2d(0.5, 0.5));
  EXPECT_EQ(FromColmapPixel(ToColmapPixel({3.25, -7})), Eigen::Vector2d(3.25, -7));
}

TEST(ColmapModel, WhatIsWrittenReadsBack) {
  for (const ColmapFormat format : {ColmapFormat::kText, ColmapFormat::kBinary}) {
    const TempFolder folder;
    Reconstruction map = SyntheticMap(1);
    map.cameras[1].distortion[6] = 0.003;  // FULL_OPENCV
    map.images[3].keypoints.clear();       // the empty line of images.txt
    map.images[3].point_idx.clear();
    for (MapPoint& point : map.points) point.track.erase(point.track.begin() + 3);
    WriteColmapModel(map, folder / "sparse/0", format);
    EXPECT_EQ(FindColmapModel(folder / "sparse/0"), format);
    ExpectSame(map, ReadColmapModel(folder / "sparse/0"));
    WriteColmapModel(map, folder / "sparse/0", format);  // again, over the first
  }
}

TEST(ColmapModel, AnEmptyMapIsAModelToo) {
  const TempFolder folder;
  WriteColmapModel({}, folder / "a", ColmapFormat::kText);
  WriteColmapModel({}, folder / "b", ColmapFormat::kBinary);
  EXPECT_TRUE(ReadColmapModel(folder / "a").images.empty());
  EXPECT_TRUE(ReadColmapModel(folder / "b").points.empty());
}

constexpr char kCameras[] =
    "# comment\n7 SIMPLE_PINHOLE 640 480 500 320.5 240.5\r\n"
    "3 RADIAL 640 480 500 320 240 0.1 -0.2\n"
    "9 OPENCV_FISHEYE 640 480 300 301 320 240 1 2 3 4\n";
constexpr char kImages[] =
    "# comment\n\n12 2 0 0 0 1 2 3 7 my walk/b.jpg\n"
    "10.5 20.5 -1 30.5 40.5 5 31.5 40.5 5\n"
    "4 0 1 0 0 0 0 0 9 a.jpg\n"
    "\n";
constexpr char kPoints[] = "# comment\n5 1 2 3 255 0 0 0.25 12 1 12 2\n";

// Writes the three files, one of them with `from` replaced by `to`.
std::string WriteModel(const TempFolder& folder, const std::string& from = "",
                       const std::string& to = "") {
  const std::pair<const char*, std::string> files[] = {
      {"m/cameras.txt", kCameras}, {"m/images.txt", kImages}, {"m/points3D.txt", kPoints}};
  for (auto [name, text] : files) {
    const std::size_t at = from.empty() ? std::string::npos : text.find(from);
    if (at != std::string::npos) text.replace(at, from.size(), to);
    folder.Write(name, text);
  }
  return folder / "m";
}

TEST(ColmapModel, ReadsWhatOthersWrite) {
  const TempFolder folder;
  const Reconstruction map = ReadColmapModel(WriteModel(folder));
  ASSERT_EQ(map.cameras.size(), 3U);
  EXPECT_EQ(map.cameras[1].model, CameraModel::kPinhole);
  EXPECT_EQ(map.cameras[1].fy, 500);
  EXPECT_EQ(map.cameras[1].cx, 320);
  EXPECT_EQ(map.cameras[0].distortion[1], -0.2);
  EXPECT_EQ(map.cameras[2].distortion[3], 4);
  ASSERT_EQ(map.images.size(), 2U);
  EXPECT_EQ(map.images[0].name, "a.jpg");
  EXPECT_EQ(map.images[0].camera_idx, 2);
  EXPECT_EQ(map.images[0].cam_from_world.rotation.x(), 1) << "the quaternion's w comes first";
  EXPECT_EQ(map.images[1].name, "my walk/b.jpg");
  EXPECT_EQ(map.images[1].cam_from_world.rotation.w(), 1) << "made a unit quaternion";
  EXPECT_EQ(map.images[1].cam_from_world.translation, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(map.images[1].keypoints[0], Eigen::Vector2d(10, 20));
  EXPECT_THAT(map.images[1].point_idx, ::testing::ElementsAre(-1, 0, -1))
      << "the second observation in one image is dropped";
  EXPECT_THAT(map.points[0].track, ::testing::ElementsAre(Observation{1, 1}));
  EXPECT_EQ(map.points[0].error_px, 0.25);
}

TEST(ColmapModel, TheLastEmptyLineMayBeMissing) {
  const TempFolder folder;
  EXPECT_EQ(ReadColmapModel(WriteModel(folder, "a.jpg\n\n", "a.jpg")).images.size(), 2U);
}

TEST(ColmapModel, NamesWhatIsWrong) {
  const std::tuple<const char*, const char*, const char*> cases[] = {
      {"SIMPLE_PINHOLE", "FOV", "cameras.txt line 2: camera model FOV is not supported"},
      {"500 320.5", "-1 320.5", "focal length is not positive"},
      {"500 320.5", "nan 320.5", "not a number"},
      {"240.5\r", "240.5 1\r", "too many parameters"},
      {"500 320.5 240.5", "500", "cameras.txt line 2: the line ends"},
      {"640 480 500 320.5", "0 480 500 320.5", "its size"},
      {"3 RADIAL", "7 RADIAL", "camera 7 stands there twice"},
      {"12 2 0 0 0", "12 0 0 0 0", "the quaternion is zero"},
      {"12 2 0 0 0", "12 inf 0 0 0", "images.txt line 3"},
      {" 7 my walk/b.jpg", " 8 my walk/b.jpg", "my walk/b.jpg: there is no camera 8"},
      {" 9 a.jpg", " 9", "images.txt line 5: the image has no name"},
      {" 9 a.jpg", " 9 my walk/b.jpg", "stands there twice"},
      {"4 0 1 0 0", "12 0 1 0 0", "image 12 stands there twice"},
      {"10.5 20.5 -1", "10.5 20.5", "not a whole number"},
      {"10.5 20.5 -1", "10.5 20.5 6", "names point 6"},
      {"12 1 12 2", "12 1", "names point 5, whose track does not hold it"},
      {"12 1 12 2", "12 1 12 0", "does not name it"},
      {"12 1 12 2", "12 1 12 9", "key point 9 of image 12 does not exist"},
      {"12 1 12 2", "12 1 13 2", "image 13 does not exist"},
      {"12 1 12 2", "12 1 12", "points3D.txt line 2: the line ends"},
      {"5 1 2 3 255", "-5 1 2 3 255", "out of range"},
  };
  for (const auto& [from, to, cause] : cases) {
    const TempFolder folder;
    EXPECT_THAT(ErrorOf(WriteModel(folder, from, to)), HasSubstr(cause)) << from << " -> " << to;
  }
  const TempFolder folder;
  EXPECT_THAT(ErrorOf(folder.path()), HasSubstr("no COLMAP model"));
}

TEST(ColmapModel, DamagedBinariesAreRefused) {
  const TempFolder folder;
  WriteColmapModel(SyntheticMap(2), folder / "good", ColmapFormat::kBinary);
  const std::string folder_name = folder / "bad";
  std::filesystem::create_directory(folder_name);
  std::mt19937 random(5);
  for (int round = 0; round < 300; ++round) {
    std::filesystem::copy(folder / "good", folder_name,
                          std::filesystem::copy_options::overwrite_existing);
    const char* names[] = {"cameras.bin", "images.bin", "points3D.bin"};
    const std::string name = names[round % 3];
    std::string bytes = ReadTextFile(folder / "good/" + name);
    if (round % 2 == 0) {
      bytes.resize(random() % bytes.size());
    } else {
      const std::size_t range = round % 5 == 0 ? 64 : bytes.size();
      for (int i = 0; i < 8; ++i) bytes[random() % range] = static_cast<char>(random());
    }
    WriteTextFile(folder_name + "/" + name, bytes);
    const std::string error = ErrorOf(folder_name);
    if (round % 2 == 0) {
      EXPECT_THAT(error, HasSubstr(folder_name));
    }
  }
}

TEST(ColmapModel, FormatsAreNotMixed) {
  const TempFolder folder;
  WriteColmapModel(SyntheticMap(1), folder / "m", ColmapFormat::kBinary);
  EXPECT_THROW(WriteColmapModel({}, folder / "m", ColmapFormat::kText), ToolError);
  Reconstruction map = SyntheticMap(1);
  map.images[0].name = "my walk/a.jpg";
  EXPECT_THROW(WriteColmapModel(map, folder / "t", ColmapFormat::kText), ToolError);
  WriteColmapModel(map, folder / "b", ColmapFormat::kBinary);
  EXPECT_EQ(ReadColmapModel(folder / "b").images[0].name, "my walk/a.jpg");
}

class ColmapProgram : public ::testing::Test {
 protected:
  void SetUp() override {
    if (std::string(COLMAP).empty()) GTEST_SKIP() << "colmap is not installed";
  }
  // What the program printed, on either stream.
  std::string Colmap(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), COLMAP);
    const ProgramRun run = RunProgram(arguments);
    EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
    return run.out + run.err;
  }
  TempFolder folder_;
};

TEST_F(ColmapProgram, ReadsWhatIsWritten) {
  WriteColmapModel(SyntheticMap(3), folder_ / "m", ColmapFormat::kBinary);
  EXPECT_THAT(Colmap({"model_analyzer", "--path", folder_ / "m"}),
              AllOf(HasSubstr("Registered images: 12"), HasSubstr("Points: 60"),
                    HasSubstr("Observations: 720")));
}

TEST_F(ColmapProgram, ConvertsToTheSameModel) {
  const Reconstruction map = SyntheticMap(3);
  WriteColmapModel(map, folder_ / "t", ColmapFormat::kText);
  WriteColmapModel(map, folder_ / "b", ColmapFormat::kBinary);
  for (const auto& [from, to, type] : {std::tuple{"t", "t_as_b", "BIN"}, {"b", "b_as_t", "TXT"}}) {
    std::filesystem::create_directory(folder_ / to);
    Colmap({"model_converter", "--input_path", folder_ / from, "--output_path", folder_ / to,
            "--output_type", type});
    ExpectSame(map, ReadColmapModel(folder_ / to));
  }
}

// A quaternion's order, a direction or half a pixel gone wrong would show as residuals.
TEST_F(ColmapProgram, SeesThePointsWhereTheyAre) {
  WriteColmapModel(SyntheticMap(3), folder_ / "m", ColmapFormat::kText);
  std::filesystem::create_directory(folder_ / "adjusted");
  const std::string text =
      Colmap({"bundle_adjuster", "--input_path", folder_ / "m", "--output_path",
              folder_ / "adjusted", "--BundleAdjustment.max_num_iterations", "1"});
  const std::size_t at = text.find("Initial cost :");
  ASSERT_NE(at, std::string::npos) << text;
  EXPECT_LT(std::stod(text.substr(at + 14)), 1e-6) << text;
}

}  // namespace
}  // namespace viewfix
