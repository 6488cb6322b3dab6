// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/dataset/image_set.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <random>
#include <string>

#include "tests/testing/temp_folder.h"

namespace viewfix {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr char kCalibration[] =
    "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n"
    "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
    "   data: [ 500.25, 0., 319.5, 0., 501., 239.5, 0., 0., 1. ]\n"
    "distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n"
    "   data: [ 0.1, -0.2, 0., 0., 0.05 ]\n";

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

std::string ErrorOf(const std::filesystem::path& path) {
  try {
    LoadImageSet(path);
  } catch (const ToolError& error) {
    return error.what();
  }
  return "no error";
}

std::string ErrorOfCsv(std::string_view csv) {
  const TempFolder folder;
  folder.Write("images.csv", csv);
  return ErrorOf(folder.path());
}

ImageSet LoadCsv(std::string_view csv) {
  const TempFolder folder;
  folder.Write("images.csv", csv);
  return LoadImageSet(folder.path());
}

TEST(LoadImageSet, ReadsColumnsInAnyOrder) {
  const ImageSet set = LoadCsv(
      "capture,view,note,path,split,location\n"
      "walk1,left,sunny,b.jpg,train,floor1/lobby\n"
      ",,,a.jpg,,\n"
      "walk1,right,,c.jpg,test,floor1/lobby\n");
  ASSERT_EQ(set.images.size(), 3);
  EXPECT_EQ(set.images[0].path, "b.jpg");
  EXPECT_EQ(set.images[0].location, "floor1/lobby");
  EXPECT_EQ(set.images[0].view, "left");
  EXPECT_EQ(set.images[0].capture, "walk1");
  EXPECT_EQ(set.images[0].other.at("note"), "sunny");
  EXPECT_FALSE(set.images[0].is_test);
  EXPECT_EQ(set.images[1].path, "a.jpg");
  EXPECT_EQ(set.images[1].location, "");
  EXPECT_FALSE(set.images[1].is_test);
  EXPECT_FALSE(set.images[1].pose.has_value());
  EXPECT_EQ(set.images[1].camera_idx, -1);
  EXPECT_TRUE(set.images[2].is_test);
}

TEST(LoadImageSet, ReadsRfc4180) {
  const ImageSet set = LoadCsv(
      "\xEF\xBB\xBFpath,location\r\n\"a,b.jpg\",\"say \"\"hi\"\"\"\r\n\r\n"
      "\"two\nlines.jpg\",B\xC3\xBCro");
  ASSERT_EQ(set.images.size(), 2);
  EXPECT_EQ(set.images[0].path, "a,b.jpg");
  EXPECT_EQ(set.images[0].location, "say \"hi\"");
  EXPECT_EQ(set.images[1].path, "two\nlines.jpg");
  EXPECT_EQ(set.images[1].location, "B\xC3\xBCro");
}

TEST(LoadImageSet, ReadsPoses) {
  const ImageSet set = LoadCsv(
      "path,tx,ty,tz,qx,qy,qz,qw\n"
      "a.jpg,1,-2.5,3e2,0.5,0.5,0.5,0.5\n"
      "b.jpg,,,,,,,\n"
      "c.jpg,0,0,0,0,0,0,1.005\n");
  ASSERT_TRUE(set.images[0].pose.has_value());
  EXPECT_EQ(set.images[0].pose->cam_in_world, Eigen::Vector3d(1, -2.5, 300));
  EXPECT_EQ(set.images[0].pose->world_from_cam.w(), 0.5);
  EXPECT_FALSE(set.images[1].pose.has_value());
  EXPECT_NEAR(set.images[2].pose->world_from_cam.norm(), 1, 1e-15);
}

TEST(LoadImageSet, ReadsCsvOfAnyName) {
  const TempFolder folder;
  const auto file = folder.Write("sub/walk.csv", "path\nimages/a.jpg\n");
  const ImageSet set = LoadImageSet(file);
  EXPECT_EQ(set.source, file);
  EXPECT_EQ(set.FullPath(set.images[0]).string(), folder / "sub/images/a.jpg");
}

TEST(LoadImageSet, ReadsFolders) {
  const TempFolder folder;
  for (const char* name : {"lobby/left/2.jpg", "lobby/left/1.JPG", "stairs/1.jpg", "0.png",
                           "floor1/hall/right/1.jpeg", "lobby/left/notes.txt", ".trash/x/1.jpg"}) {
    folder.Write(name, "");
  }
  folder.Write("calibration.yaml", kCalibration);
  for (const auto& path : {folder.path(), folder / "."}) {
    const ImageSet set = LoadImageSet(path);
    std::vector<std::string> lines;
    for (const ImageRecord& image : set.images) {
      lines.push_back(image.path + "|" + image.location + "|" + image.view);
      EXPECT_EQ(image.camera_idx, 0);
    }
    EXPECT_THAT(lines,
                ::testing::ElementsAre("0.png||", "floor1/hall/right/1.jpeg|floor1/hall|right",
                                       "lobby/left/1.JPG|lobby|left", "lobby/left/2.jpg|lobby|left",
                                       "stairs/1.jpg|stairs|"));
  }
}

TEST(LoadImageSet, ReadsCameras) {
  const TempFolder folder;
  folder.Write("calibration.yaml", kCalibration);
  folder.Write("cams/wide.yaml", Replaced(kCalibration, "500.25", "250"));
  folder.Write("images.csv",
               "path,camera\na.jpg,\nb.jpg,cams/wide.yaml\nc.jpg,./cams/wide.yaml\n"
               "d.jpg,calibration.yaml\n");
  const ImageSet set = LoadImageSet(folder.path());
  ASSERT_EQ(set.cameras.size(), 2);
  EXPECT_EQ(set.cameras[0].fx, 500.25);
  EXPECT_EQ(set.cameras[0].cy, 239.5);
  EXPECT_THAT(set.cameras[0].distortion, ::testing::ElementsAre(0.1, -0.2, 0, 0, 0.05));
  EXPECT_EQ(set.cameras[1].fx, 250);
  EXPECT_EQ(set.images[0].camera_idx, 0);
  EXPECT_EQ(set.images[1].camera_idx, 1);
  EXPECT_EQ(set.images[2].camera_idx, 1);
  EXPECT_EQ(set.images[3].camera_idx, 0);
}

TEST(LoadImageSet, NamesWhatIsWrongWithCalibration) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {Replaced(kCalibration, "500.25", "-500.25"), "focal length is not positive"},
      {Replaced(kCalibration, "500.25", "0."), "focal length is not positive"},
      {Replaced(kCalibration, "319.5", ".Nan"), "not finite"},
      {Replaced(kCalibration, "0.05", ".Inf"), "not finite"},
      {Replaced(kCalibration, "image_width: 640", "image_width: 0"), "image_width"},
      {Replaced(kCalibration, "image_height: 480", "image_height: tall"), "image_height"},
      {Replaced(kCalibration, "image_height: 480\n", ""), "image_height"},
      {Replaced(kCalibration, "camera_matrix", "k"), "camera_matrix"},
      {Replaced(kCalibration, "rows: 3", "rows: -3"), "camera_matrix"},
      {Replaced(kCalibration, "cols: 5", "cols: 4"), "distortion"},
      {Replaced(kCalibration, "501., 239.5, 0.", "501., 239.5, 1."), "form"},
      {std::string(kCalibration).substr(0, 120), "camera_matrix"},
      {"", "OpenCV"},
      {"hello", "OpenCV"},
      {std::string("%YAML:1.0\0---", 13), "text"},
  };
  for (const auto& [text, cause] : cases) {
    const TempFolder folder;
    folder.Write("images.csv", "path\na.jpg\n");
    folder.Write("calibration.yaml", text);
    EXPECT_THAT(ErrorOf(folder.path()), AllOf(HasSubstr("calibration.yaml"), HasSubstr(cause)))
        << text;
  }
}

TEST(LoadImageSet, NamesTheLineOfAMissingCalibration) {
  EXPECT_THAT(ErrorOfCsv("path,camera\na.jpg,\nb.jpg,none.yaml\n"),
              AllOf(HasSubstr("images.csv line 3"), HasSubstr("none.yaml")));
}

TEST(LoadImageSet, NamesWhatIsWrongWithRows) {
  const std::string pose = "path,tx,ty,tz,qx,qy,qz,qw\na.jpg,0,0,0,0,0,0,1\nb.jpg,";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"", "header"},
      {"\n\n", "header"},
      {"name,location\na,b\n", "path"},
      {"path,location\n", "no images"},
      {"path,path\na,b\n", "twice"},
      {"path,tx,ty,tz,qx,qy,qz\na.jpg,0,0,0,0,0,0\n", "qw is missing"},
      {"path\na.jpg\n\nb.jpg\n./b.jpg\n", "line 5: path ./b.jpg stands in line 4 too"},
      {"path\na.jpg\n\"\"\n", "line 3: the path is empty"},
      {"path,location\na.jpg,x\nb.jpg\n", "line 3"},
      {"path,location\na.jpg,x,y\n", "line 2"},
      {"path\n\"a.jpg\n", "line 2"},
      {"path\n\"a\"b.jpg\n", "line 2"},
      {std::string("path\na\0.jpg\n", 12), "NUL"},
      {"path\na\xFF.jpg\n", "UTF-8 text (line 2)"},
      {"path\n\xED\xA0\x80.jpg\n", "UTF-8"},
      {"path,split\na.jpg,validation\n", "line 2: split is validation"},
      {"path,location\na.jpg,/lobby\n", "empty part"},
      {"path,location\na.jpg,floor//lobby\n", "empty part"},
      {"path,location\na.jpg,floor/\n", "empty part"},
      {pose + "nan,0,0,0,0,0,1\n", "line 3: tx is not finite"},
      {pose + "0,-inf,0,0,0,0,1\n", "line 3: ty is not finite"},
      {pose + "0,0,1e999,0,0,0,1\n", "line 3: tz is not finite"},
      {pose + "1e308,0,0,0,0,0,1\n", "line 3: the position"},
      {pose + "0,0,0,1e308,1e308,1e308,1e308\n", "line 3: the quaternion"},
      {pose + "0,0,0,0,0,0,0\n", "line 3: the quaternion"},
      {pose + "0,0,0,0,0,0,1.02\n", "line 3: the quaternion"},
      {pose + "0,0,0,0,0,0,one\n", "line 3: qw is not a number: one"},
      {pose + "0,0,0 m,0,0,0,1\n", "line 3: tz is not a number"},
      {pose + "0,0,0,,0,0,1\n", "line 3: some pose cells are empty"},
  };
  for (const auto& [csv, cause] : cases) {
    EXPECT_THAT(ErrorOfCsv(csv), AllOf(HasSubstr("images.csv"), HasSubstr(cause))) << csv;
  }
}

TEST(LoadImageSet, NamesMissingAndEmptyFolders) {
  const TempFolder folder;
  EXPECT_THAT(ErrorOf(folder / "none"), AllOf(HasSubstr("none"), HasSubstr("no such")));
  EXPECT_THAT(ErrorOf(folder.path()), HasSubstr("no images"));
  folder.Write("room/bad\xFFname.jpg", "");
  EXPECT_THAT(ErrorOf(folder.path()), HasSubstr("UTF-8"));
  std::filesystem::create_directory(folder / "images.csv");
  EXPECT_THAT(ErrorOf(folder.path()), HasSubstr("images.csv"));
}

TEST(LoadImageSet, SurvivesRandomBytes) {
  std::mt19937 random(7);
  const std::string alphabet = "path,\",\"\r\n\n,tx1e9-\xC3\xBC\xFF ";
  for (int round = 0; round < 2000; ++round) {
    std::string csv = round % 2 == 0 ? "path,location\n" : "";
    for (int i = 0; i < round % 97; ++i) {
      csv.push_back(round % 3 == 0 ? static_cast<char>(random())
                                   : alphabet[random() % alphabet.size()]);
    }
    const TempFolder folder;
    folder.Write("images.csv", csv);
    try {
      const ImageSet set = LoadImageSet(folder.path());
      for (const ImageRecord& image : set.images) EXPECT_FALSE(image.path.empty());
    } catch (const ToolError& error) {
      EXPECT_THAT(error.what(), HasSubstr("images.csv"));
    }
  }
}

TEST(LoadImageSet, TakesHugeCellsAndManyRows) {
  const std::string huge(1 << 22, 'x');
  EXPECT_EQ(LoadCsv("path,note\na.jpg,\"" + huge + "\"\n").images[0].other.at("note"), huge);
  std::string csv = "path,location,view\n";
  for (int i = 0; i < 100000; ++i) {
    csv += "images/" + std::to_string(i) + ".jpg,room" + std::to_string(i % 50) + ",left\n";
  }
  const ImageSet set = LoadCsv(csv);
  ASSERT_EQ(set.images.size(), 100000);
  EXPECT_EQ(set.images[99999].path, "images/99999.jpg");
}

void ExpectSame(const ImageSet& a, const ImageSet& b) {
  ASSERT_EQ(a.images.size(), b.images.size());
  for (std::size_t i = 0; i < a.images.size(); ++i) {
    const ImageRecord& x = a.images[i];
    const ImageRecord& y = b.images[i];
    EXPECT_EQ(x.path, y.path);
    EXPECT_EQ(x.location, y.location);
    EXPECT_EQ(x.view, y.view);
    EXPECT_EQ(x.capture, y.capture);
    EXPECT_EQ(x.is_test, y.is_test);
    EXPECT_EQ(x.camera_idx, y.camera_idx);
    EXPECT_EQ(x.other, y.other);
    ASSERT_EQ(x.pose.has_value(), y.pose.has_value());
    if (!x.pose) continue;
    EXPECT_EQ(x.pose->cam_in_world, y.pose->cam_in_world);
    EXPECT_EQ(x.pose->world_from_cam.coeffs(), y.pose->world_from_cam.coeffs());
  }
  ASSERT_EQ(a.cameras.size(), b.cameras.size());
  for (std::size_t i = 0; i < a.cameras.size(); ++i) {
    const Calibration& x = a.cameras[i];
    const Calibration& y = b.cameras[i];
    EXPECT_EQ(std::tie(x.width, x.height, x.fx, x.fy, x.cx, x.cy, x.distortion),
              std::tie(y.width, y.height, y.fx, y.fy, y.cx, y.cy, y.distortion));
  }
}

ImageSet MixedSet(const std::filesystem::path& folder) {
  ImageSet set;
  set.folder = folder;
  set.cameras = {{640, 480, 500.1, 1.0 / 3, 319.5, 239.5, {0.1, -1e-17, 0, 0, 2.0 / 3}},
                 {64, 48, 50, 50, 31.5, 23.5, {}}};
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 40; ++i) {
    ImageRecord image;
    image.path = "a, \"b\"\n" + std::to_string(i) + ".jpg";
    image.location = i % 4 == 0 ? "" : "floor/B\xC3\xBCro " + std::to_string(i % 3);
    image.view = i % 5 == 0 ? "" : "left";
    image.capture = i % 2 == 0 ? "walk" : "";
    image.is_test = i % 7 == 0;
    image.camera_idx = i % 2;
    if (i % 3 == 0) image.other["note"] = "n" + std::to_string(i);
    if (i % 6 != 1) {
      image.pose =
          Pose{Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random))
                   .normalized(),
               {normal(random), normal(random) * 1e8, normal(random) * 1e-300}};
    }
    set.images.push_back(image);
  }
  return set;
}

TEST(SaveImageSet, LoadGivesTheSetBack) {
  const TempFolder folder;
  ImageSet set = MixedSet(folder.path());
  SaveImageSet(set);
  ExpectSame(set, LoadImageSet(folder.path()));
}

TEST(SaveImageSet, LoadGivesBackImagesWithoutCamera) {
  const TempFolder folder;
  ImageSet set = MixedSet(folder.path());
  set.images[1].camera_idx = -1;
  SaveImageSet(set);
  ExpectSame(set, LoadImageSet(folder.path()));
}

TEST(SaveImageSet, WritesOnlyColumnsInUse) {
  const TempFolder folder;
  ImageSet set;
  set.folder = folder.path();
  set.images.resize(1);
  set.images[0].path = "a.jpg";
  set.images[0].location = "lobby";
  SaveImageSet(set);
  std::ifstream stream(folder / "images.csv");
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(stream), {}),
            "path,location\na.jpg,lobby\n");
}

TEST(SaveImageSet, LeavesNothingHalfWritten) {
  const TempFolder folder;
  ImageSet set;
  set.folder = folder / "none";
  set.images.resize(1);
  set.images[0].path = "a.jpg";
  try {
    SaveImageSet(set);
    FAIL() << "wrote into a folder that does not exist";
  } catch (const ToolError& error) {
    EXPECT_THAT(error.what(), HasSubstr("images.csv"));
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace
}  // namespace viewfix
