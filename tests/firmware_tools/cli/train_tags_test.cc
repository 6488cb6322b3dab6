// SPDX-License-Identifier: BSD-3-Clause
// `viewfix train --tags` from photographs of walls with AprilTags to a model in the tags' frame.
#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/aruco.hpp>
#include <opencv2/core.hpp>
#include <sstream>

#include "firmware_tools/mapping/georeference.h"
#include "tests/firmware_tools/cli/viewfix_program.h"
#include "tests/firmware_tools/plane_renderer.h"
#include "tests/testing/jpeg_encoder.h"
#include "tests/testing/temp_folder.h"

namespace viewfix {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr int kWallWidth = 340;  // pixels of its texture
constexpr int kWallHeight = 250;
constexpr double kTexel = 0.008;  // metres, of the set
constexpr int kTagSide = 64;      // texels: eight a module
constexpr int kTagLeft = 138;
constexpr int kTagTop = 93;
constexpr int kMargin = 16;
constexpr int kWalls = 4;
constexpr int kImagesOfWall = 5;

const Camera kCamera = {CameraModel::kPinhole, 320, 240, 320, 320, 159.5, 119.5, {}};

// y of the set is down, and its unit nine tenths of a metre.
const Similarity kSiteFromSet = {
    0.9,
    Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ()) *
                       Eigen::AngleAxisd(-M_PI / 2, Eigen::Vector3d::UnitX())),
    {100, -50, 3}};

// One tag, with its white margin, among discs.
cv::Mat WallTexture(int wall) {
  auto discs = MakeTexture(kWallWidth, kWallHeight, 40 + wall);
  cv::Mat texture = cv::Mat(kWallHeight, kWallWidth, CV_8U, discs.data()).clone();
  texture(cv::Rect(kTagLeft - kMargin, kTagTop - kMargin, kTagSide + 2 * kMargin,
                   kTagSide + 2 * kMargin)) = 255;
  cv::Mat marker;
  cv::aruco::drawMarker(cv::aruco::getPredefinedDictionary(cv::aruco::DICT_APRILTAG_36h11), wall,
                        kTagSide, marker);
  marker.copyTo(texture(cv::Rect(kTagLeft, kTagTop, kTagSide, kTagSide)));
  return texture;
}

// The walls of a room, each a quarter turn from the one before, at heights of their own.
Rigid3 SetFromWall(int wall) {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(wall * M_PI / 2, Eigen::Vector3d::UnitY()));
  return {turn, turn * Eigen::Vector3d(-1.4, 0.3 * wall - 1.0, 3)};
}

// Two metres from the wall, from its left to its right.
Rigid3 SetFromCam(int wall, int i) {
  const Rigid3 wall_from_cam = {
      Eigen::Quaterniond(Eigen::AngleAxisd(0.1 * (2 - i), Eigen::Vector3d::UnitY())),
      Eigen::Vector3d(1.36 + 0.25 * (i - 2), 1.0 + 0.05 * (i % 2), -2)};
  return SetFromWall(wall) * wall_from_cam;
}

// Edges of a texel lie half of one beside its centre.
std::array<Eigen::Vector3d, 4> TagCornersInSite(int wall) {
  const double left = kTexel * (kTagLeft - 0.5), top = kTexel * (kTagTop - 0.5);
  const double right = left + kTexel * kTagSide, bottom = top + kTexel * kTagSide;
  const Eigen::Vector3d in_wall[] = {
      {left, top, 0}, {right, top, 0}, {right, bottom, 0}, {left, bottom, 0}};
  std::array<Eigen::Vector3d, 4> in_site;
  for (int k = 0; k < 4; ++k) in_site[k] = kSiteFromSet * (SetFromWall(wall) * in_wall[k]);
  return in_site;
}

class TrainTagsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::ostringstream csv;
    csv << "path,location,view,tx,ty,tz,qx,qy,qz,qw\n";
    const PlaneRenderer renderer(kCamera);
    for (int wall = 0; wall < kWalls; ++wall) {
      const cv::Mat texture = WallTexture(wall);
      for (int i = 0; i < kImagesOfWall; ++i) WriteImage(renderer, texture, wall, i, csv);
    }
    folder_.Write("room/images.csv", csv.str());
    folder_.Write(
        "room/calibration.yaml",
        std::string_view("%YAML:1.0\n---\nimage_width: 320\nimage_height: 240\n"
                         "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n"
                         "   dt: d\n   data: [ 320, 0, 159.5, 0, 320, 119.5, 0, 0, 1 ]\n"));
  }

  void WriteImage(const PlaneRenderer& renderer, const cv::Mat& texture, int wall, int i,
                  std::ostream& csv) const {
    const Rigid3 set_from_cam = SetFromCam(wall, i);
    const cv::Mat image =
        renderer.Render(Inverse(set_from_cam) * SetFromWall(wall), texture, kTexel);
    std::string name = std::to_string(kImagesOfWall * wall + i);
    name += ".jpg";
    folder_.Write("room/" + name, EncodeJpeg({image.data, image.total()}, image.cols, image.rows, 1,
                                             {.quality = 95}));
    const Eigen::Vector3d& t = set_from_cam.translation;
    const Eigen::Quaterniond& q = set_from_cam.rotation;
    csv.precision(12);
    csv << name << (wall < 2 ? ",hall," : ",stair,") << (wall % 2 == 0 ? "left," : "right,")
        << t.x() << "," << t.y() << "," << t.z() << "," << q.x() << "," << q.y() << "," << q.z()
        << "," << q.w() << "\n";
  }

  // The tag of each wall, moved so many metres along x.
  std::string TagFile(const std::array<double, kWalls>& moved) const {
    std::ostringstream csv;
    csv.precision(12);
    csv << "family,id,x0,y0,z0,x1,y1,z1,x2,y2,z2,x3,y3,z3\n";
    for (int wall = 0; wall < kWalls; ++wall) {
      csv << "tag36h11," << wall;
      for (const Eigen::Vector3d& corner : TagCornersInSite(wall)) {
        csv << "," << corner.x() + moved[wall] << "," << corner.y() << "," << corner.z();
      }
      csv << "\n";
    }
    return folder_.Write("tags.csv", csv.str());
  }

  ProgramRun Train(const std::string& tags) const {
    return Viewfix({"train", folder_ / "room", "--out", Model(), "--words", "20", "--max-features",
                    "300", "--map", "poses", "--tags", tags});
  }
  std::string Model() const { return folder_ / "room.vfx"; }

  // Every keyframe of the model stands where its photograph was taken, to a centimetre.
  void ExpectInTheTagsFrame() const {
    const std::string tum = folder_ / "room.tum";
    const ProgramRun run = Viewfix({"export", Model(), "--format", "tum", "--out", tum});
    ASSERT_EQ(run.exit_code, 0) << run.err;
    std::ifstream file(tum);
    std::string line;
    std::getline(file, line);  // the names of the columns
    int rows = 0;
    for (; std::getline(file, line); ++rows) {
      int name = 0;
      Eigen::Vector3d t;
      Eigen::Quaterniond q;
      std::istringstream(line) >> name >> t.x() >> t.y() >> t.z() >> q.x() >> q.y() >> q.z() >>
          q.w();
      const Rigid3 truth = SetFromCam(name / kImagesOfWall, name % kImagesOfWall);
      EXPECT_LT((t - kSiteFromSet * truth.translation).norm(), 0.01) << name;
      EXPECT_LT(q.angularDistance(kSiteFromSet.rotation * truth.rotation), 0.005) << name;
    }
    EXPECT_EQ(rows, kWalls * kImagesOfWall);
  }

  TempFolder folder_;
};

TEST_F(TrainTagsTest, TheModelStandsInTheTagsFrame) {
  const ProgramRun train = Train(TagFile({}));
  ASSERT_EQ(train.exit_code, 0) << train.err;
  EXPECT_THAT(train.err, AllOf(HasSubstr("map 0: control points, median 0.00"),
                               HasSubstr("tag36h11 3 corner 3"), Not(HasSubstr("left out"))));
  ExpectInTheTagsFrame();
  const auto model = nlohmann::json::parse(Viewfix({"inspect", Model(), "--json"}).out);
  EXPECT_EQ(model["maps"][0]["metric"], true);
  EXPECT_EQ(model["training"]["map"]["maps"][0]["control"]["residuals"].size(), 4U * kWalls);
}

TEST_F(TrainTagsTest, OneWrongTagIsLeftOutByName) {
  const ProgramRun train = Train(TagFile({0, 0, 2, 0}));
  ASSERT_EQ(train.exit_code, 0) << train.err;
  EXPECT_THAT(train.err, AllOf(HasSubstr("tag36h11 2 corner 0 2.00 m (left out)"),
                               Not(HasSubstr("tag36h11 1 corner 0 0.00 m (left out)"))));
  ExpectInTheTagsFrame();
}

TEST_F(TrainTagsTest, WrongTagsAreRefusedWithTheirResiduals) {
  const ProgramRun train = Train(TagFile({0, 3, 0, -4}));
  EXPECT_EQ(train.exit_code, 1);
  EXPECT_THAT(LastLine(train), AllOf(HasSubstr("tags.csv: control points do not fit the map"),
                                     HasSubstr("worst: tag36h11 "), HasSubstr(" m")));
  EXPECT_FALSE(std::filesystem::exists(Model()));
}

}  // namespace
}  // namespace viewfix
