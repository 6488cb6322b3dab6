// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/dataset/pose_import.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

#include "firmware_tools/dataset/calibration_file.h"
#include "firmware_tools/dataset/text_fields.h"
#include "firmware_tools/mapping/colmap_model.h"
#include "tests/testing/temp_folder.h"

namespace viewfix {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

// A pose of which no two numbers are alike, so that any mix-up shows.
Pose OddPose(unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Eigen::Vector4d q;
  for (double& value : q) value = normal(random);
  return {Eigen::Quaterniond(q.normalized()), {normal(random), normal(random), normal(random)}};
}

void ExpectSamePose(const Pose& a, const Pose& b) {
  EXPECT_LT(a.world_from_cam.angularDistance(b.world_from_cam), 1e-7);
  EXPECT_TRUE(a.cam_in_world.isApprox(b.cam_in_world, 1e-12))
      << a.cam_in_world.transpose() << " / " << b.cam_in_world.transpose();
}

std::string ErrorOf(const std::filesystem::path& path) {
  try {
    ReadPoses(path);
  } catch (const ToolError& error) {
    return error.what();
  }
  return "no error";
}

std::string TumLine(const std::string& time, const Pose& pose) {
  std::string line = time;
  for (const double value : pose.cam_in_world) line.append(" ").append(ExactNumber(value));
  for (const double value : pose.world_from_cam.coeffs()) {
    line.append(" ").append(ExactNumber(value));
  }
  return line + "\n";
}

ImageSet SetOf(const std::vector<std::string>& paths) {
  ImageSet set;
  for (const std::string& path : paths) set.images.emplace_back().path = path;
  return set;
}

TEST(Tum, PosesByNameAndTime) {
  const TempFolder folder;
  const Pose pose[] = {OddPose(1), OddPose(2)};
  const ImportedPoses poses = ReadPoses(
      folder.Write("walk.txt", "# timestamp tx ty tz qx qy qz qw\n" + TumLine("img_7", pose[0]) +
                                   "\n" + TumLine("1305031102.175304", pose[1])));
  EXPECT_EQ(poses.images[0].pose.world_from_cam.coeffs(), pose[0].world_from_cam.coeffs());
  ImageSet set = SetOf({"rgb/img_7.png", "rgb/1305031102.175304.png", "rgb/1305031102.900000.png",
                        "1305031102175304000.png"});
  const PoseMatches matches = ApplyPoses(poses, set);
  EXPECT_EQ(matches.matched, 3);
  EXPECT_EQ(matches.unmatched, 1);
  ExpectSamePose(*set.images[0].pose, pose[0]);
  ExpectSamePose(*set.images[1].pose, pose[1]);
  EXPECT_FALSE(set.images[2].pose.has_value());
  ExpectSamePose(*set.images[3].pose, pose[1]);
}

TEST(Tum, InterpolatesBetweenNeighbours) {
  const TempFolder folder;
  const Pose a{Eigen::Quaterniond::Identity(), {0, 0, 0}};
  const Pose b{Eigen::Quaterniond(Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY())), {0.1, 0, 0}};
  const auto file =
      folder.Write("walk.tum", TumLine("10.0", a) + TumLine("10.1", b) + TumLine("20.0", b));
  ImageSet set = SetOf({"10.025.jpg", "15.0.jpg", "9.9.jpg", "20.1.jpg"});
  EXPECT_EQ(ApplyPoses(ReadPoses(file), set).matched, 1);
  EXPECT_NEAR(set.images[0].pose->cam_in_world.x(), 0.025, 1e-9);
  EXPECT_NEAR(set.images[0].pose->world_from_cam.angularDistance(a.world_from_cam), 0.05, 1e-9);
}

TEST(Tum, NamesWhatIsWrong) {
  const std::pair<const char*, const char*> cases[] = {
      {"", "no poses"},
      {"# only comments\n", "no poses"},
      {"1 0 0 0 0 0 0 1\n2 0 0 0 0 0 1\n", "line 2: the line ends before the quaternion"},
      {"1 0 0 0 0 0 0 1 7\n", "line 1: more than"},
      {"1 0 0 nan 0 0 0 1\n", "line 1: the position is not a number: nan"},
      {"1 0 0 1e999 0 0 0 1\n", "line 1: the position"},
      {"1 0 0 0 0 0 0 2\n", "line 1: the quaternion"},
      {"1 0 0 0 0 0 0 0\n", "line 1: the quaternion"},
      {"1,0,0,0,0,0,0,1\n", "line 1"},
  };
  const TempFolder folder;
  for (const auto& [text, cause] : cases) {
    EXPECT_THAT(ErrorOf(folder.Write("a.txt", std::string_view(text))),
                AllOf(HasSubstr("a.txt"), HasSubstr(cause)))
        << text;
  }
  ImageSet set = SetOf({"other.jpg"});
  const auto poses = ReadPoses(folder.Write("b.txt", TumLine("x", OddPose(1))));
  EXPECT_THROW(ApplyPoses(poses, set), ToolError);
}

// The file that nerfstudio would write of a pose whose world was turned by `applied`.
nlohmann::json GlMatrix(const Pose& pose, const Eigen::Isometry3d& applied, double scale) {
  Eigen::Isometry3d world_from_cam = Eigen::Isometry3d::Identity();
  world_from_cam.linear() = pose.world_from_cam.toRotationMatrix();
  world_from_cam.translation() = pose.cam_in_world;
  Eigen::Matrix4d m = (applied * world_from_cam).matrix();
  m.col(1) *= -1;  // y up
  m.col(2) *= -1;  // z back
  m.block<3, 1>(0, 3) *= scale;
  nlohmann::json rows;
  for (int r = 0; r < 4; ++r) rows.push_back({m(r, 0), m(r, 1), m(r, 2), m(r, 3)});
  return rows;
}

nlohmann::json Transforms(const std::vector<Pose>& poses, const Eigen::Isometry3d& applied,
                          double scale) {
  nlohmann::json root = {{"camera_model", "OPENCV"},
                         {"fl_x", 500.25},
                         {"fl_y", 501},
                         {"cx", 320},
                         {"cy", 240.5},
                         {"w", 640},
                         {"h", 480},
                         {"k1", 0.1},
                         {"k2", -0.2},
                         {"p1", 0.01},
                         {"p2", 0.02}};
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const std::string name = std::string("./images/") + static_cast<char>('a' + i);
    root["frames"].push_back({{"file_path", i == 0 ? name : name + ".jpg"},
                              {"transform_matrix", GlMatrix(poses[i], applied, scale)}});
  }
  return root;
}

TEST(TransformsJson, PosesAndCameras) {
  const TempFolder folder;
  const std::vector<Pose> poses = {OddPose(1), OddPose(2), OddPose(3)};
  nlohmann::json root = Transforms(poses, Eigen::Isometry3d::Identity(), 1);
  root["frames"][2]["fl_x"] = 300;
  root["frames"][2]["camera_model"] = "OPENCV_FISHEYE";
  root["test_filenames"] = {"./images/b.jpg"};
  for (const char* name : {"images/a.png", "images/b.jpg", "images/c.jpg"}) folder.Write(name, "");
  folder.Write("transforms.json", root.dump());
  const ImageSet set = LoadImageSet(folder.path());
  ASSERT_EQ(set.images.size(), 3U);
  EXPECT_EQ(set.images[0].path, "images/a.png") << "given without its extension";
  EXPECT_EQ(set.source, folder / "transforms.json");
  for (int i = 0; i < 3; ++i) ExpectSamePose(*set.images[i].pose, poses[i]);
  EXPECT_TRUE(set.images[1].is_test);
  EXPECT_FALSE(set.images[0].is_test);
  ASSERT_EQ(set.cameras.size(), 2U);
  EXPECT_EQ(set.images[1].camera_idx, 0);
  EXPECT_EQ(set.images[2].camera_idx, 1);
  EXPECT_EQ(
      ToCamera(set.cameras[0]),
      (Camera{
          CameraModel::kBrownConrady, 640, 480, 500.25, 501, 319.5, 240, {0.1, -0.2, 0.01, 0.02}}));
  EXPECT_EQ(set.cameras[1].model, CameraModel::kKannalaBrandt);
  EXPECT_EQ(set.cameras[1].fx, 300);
}

TEST(TransformsJson, UndoesWhatWasApplied) {
  const TempFolder folder;
  Eigen::Isometry3d applied = Eigen::Isometry3d::Identity();
  applied.linear() << 0, 1, 0, 1, 0, 0, 0, 0, -1;
  applied.translation() = Eigen::Vector3d(1, 2, 3);
  const std::vector<Pose> poses = {OddPose(4), OddPose(5)};
  nlohmann::json root = Transforms(poses, applied, 0.25);
  for (int r = 0; r < 3; ++r) {
    const auto row = applied.matrix().row(r);
    root["applied_transform"].push_back({row(0), row(1), row(2), row(3)});
  }
  root["applied_scale"] = 0.25;
  const ImportedPoses read = ReadPoses(folder.Write("transforms.json", root.dump()));
  for (int i = 0; i < 2; ++i) ExpectSamePose(read.images[i].pose, poses[i]);
}

TEST(TransformsJson, FieldOfViewInsteadOfFocalLength) {
  const TempFolder folder;
  nlohmann::json root = Transforms({OddPose(1)}, Eigen::Isometry3d::Identity(), 1);
  for (const char* key : {"fl_x", "fl_y", "cx", "cy", "k1", "k2", "p1", "p2"}) root.erase(key);
  root["camera_angle_x"] = 2 * std::atan(0.5);
  const ImportedPoses poses = ReadPoses(folder.Write("t.json", root.dump()));
  const Camera camera = ToCamera(poses.cameras.at(0));
  EXPECT_EQ(camera.model, CameraModel::kPinhole);
  EXPECT_NEAR(camera.fx, 640, 1e-9);
  EXPECT_EQ(camera.cx, 319.5);
}

TEST(TransformsJson, NamesWhatIsWrong) {
  const nlohmann::json good =
      Transforms({OddPose(1), OddPose(2)}, Eigen::Isometry3d::Identity(), 1);
  using Change = std::function<void(nlohmann::json&)>;
  const std::pair<Change, const char*> cases[] = {
      {[](auto& r) { r = 7; }, "not a JSON object"},
      {[](auto& r) { r.erase("frames"); }, "no list of frames"},
      {[](auto& r) { r["frames"][1] = "x"; }, "frame 1: no file_path"},
      {[](auto& r) { r["frames"][1]["file_path"] = 3; }, "frame 1: no file_path"},
      {[](auto& r) { r["frames"][1].erase("transform_matrix"); }, "frame 1: no transform_matrix"},
      {[](auto& r) { r["frames"][1]["transform_matrix"][0][0] = "x"; }, "not a number"},
      {[](auto& r) { r["frames"][1]["transform_matrix"][0][0] = nullptr; }, "not a number"},
      {[](auto& r) { r["frames"][1]["transform_matrix"][0][0] = 9; }, "not a rotation"},
      {[](auto& r) {
         r["frames"][1]["transform_matrix"].erase(3);
         r["frames"][1]["transform_matrix"].erase(2);
       },
       "3x4"},
      {[](auto& r) { r["frames"][1]["transform_matrix"][0][3] = 1e12; }, "1e9"},
      {[](auto& r) {
         for (auto& row : r["frames"][1]["transform_matrix"])
           row[0] = -row[0].template get<double>();
       },
       "not a rotation"},
      {[](auto& r) { r["camera_model"] = "EQUIRECTANGULAR"; }, "EQUIRECTANGULAR"},
      {[](auto& r) { r["fl_x"] = -1; }, "focal length"},
      {[](auto& r) { r.erase("w"); }, "no image size w"},
      {[](auto& r) { r["k4"] = 1; }, "k4"},
      {[](auto& r) {
         r["applied_transform"] = {1, 2};
       },
       "applied_transform"},
      {[](auto& r) { r["applied_scale"] = 0; }, "applied_scale"},
  };
  const TempFolder folder;
  for (const auto& [change, cause] : cases) {
    nlohmann::json root = good;
    change(root);
    EXPECT_THAT(ErrorOf(folder.Write("t.json", root.dump())),
                AllOf(HasSubstr("t.json"), HasSubstr(cause)));
  }
  const std::string text = good.dump();
  EXPECT_THAT(ErrorOf(folder.Write("t.json", text.substr(0, text.size() / 2))), HasSubstr("JSON"));
}

// A COLMAP model of one image, written by the project's own writer, which COLMAP itself agrees
// with (colmap_model_test.cc).
Reconstruction OneImage(const Pose& pose) {
  Reconstruction map;
  map.cameras = {{CameraModel::kPinhole, 640, 480, 500, 501, 319.5, 239.5, {}}};
  MapImage& image = map.images.emplace_back();
  image.name = "walk/a.jpg";
  image.camera_idx = 0;
  image.cam_from_world = Inverse({pose.world_from_cam, pose.cam_in_world});
  return map;
}

TEST(ColmapPoses, AreASetOfTheirOwn) {
  for (const ColmapFormat format : {ColmapFormat::kText, ColmapFormat::kBinary}) {
    const TempFolder folder;
    folder.Write("images/walk/a.jpg", "");
    WriteColmapModel(OneImage(OddPose(6)), folder / "sparse/0", format);
    for (const std::string& path : {folder.path(), folder / "sparse/0", folder / "sparse/0/"}) {
      const ImageSet set = LoadImageSet(path);
      ASSERT_EQ(set.images.size(), 1U);
      EXPECT_TRUE(std::filesystem::exists(set.FullPath(set.images[0])));
      ExpectSamePose(*set.images[0].pose, OddPose(6));
      EXPECT_EQ(set.cameras[0].cx, 319.5);
      EXPECT_EQ(set.images[0].camera_idx, 0);
    }
  }
}

TEST(ColmapPoses, WithoutTheImagesAreNoSet) {
  const TempFolder folder;
  WriteColmapModel(OneImage(OddPose(6)), folder / "m", ColmapFormat::kText);
  EXPECT_THROW(LoadImageSet(folder / "m"), ToolError);
  EXPECT_THAT(ErrorOf(folder.path()), HasSubstr("neither"));
}

TEST(ApplyPoses, ByPathThenByName) {
  ImportedPoses poses;
  poses.source = "poses";
  poses.cameras.push_back({640, 480, 500, 500, 1, 2, {}});
  for (const char* name : {"x/a.png", "x/b.png", "y/b.png", "c.png"}) {
    const auto seed = static_cast<unsigned>(poses.images.size());
    poses.images.push_back({name, std::nullopt, OddPose(seed), 0});
  }
  ImageSet set = SetOf({"./x/../x/a.png", "x/b.png", "z/b.png", "w/c.jpg", "d.jpg"});
  set.cameras.push_back({64, 48, 50, 50, 1, 2, {}});
  set.images[1].camera_idx = 0;
  set.images[4].pose = OddPose(9);
  const PoseMatches matches = ApplyPoses(poses, set);
  EXPECT_EQ(matches.matched, 3);
  EXPECT_EQ(matches.unmatched, 2);
  EXPECT_EQ(matches.unused, 1);
  ExpectSamePose(*set.images[0].pose, OddPose(0));
  ExpectSamePose(*set.images[1].pose, OddPose(1));
  EXPECT_FALSE(set.images[2].pose.has_value()) << "two poses are of a b.png";
  ExpectSamePose(*set.images[3].pose, OddPose(3));
  ExpectSamePose(*set.images[4].pose, OddPose(9));
  EXPECT_EQ(set.images[0].camera_idx, 1);
  EXPECT_EQ(set.images[1].camera_idx, 0) << "keeps its own";
}

}  // namespace
}  // namespace viewfix
