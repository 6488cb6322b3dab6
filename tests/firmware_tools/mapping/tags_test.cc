// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/tags.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/aruco.hpp>
#include <opencv2/imgcodecs.hpp>

#include "firmware_tools/dataset/image_set.h"
#include "tests/firmware_tools/plane_renderer.h"
#include "tests/testing/temp_folder.h"

namespace viewfix {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(TagFile, PoseAndCornersSayTheSame) {
  const TempFolder folder;
  // A tag that hangs on a wall along the site's x axis: its y is the site's z.
  const auto by_pose = ReadTagFile(
      folder.Write("a.csv",
                   "family,id,size_m,tx,ty,tz,qx,qy,qz,qw\n"
                   "tag36h11,7,0.2,1,2,1.5,0.70710678118654752,0,0,0.70710678118654752\n"));
  const auto by_corners =
      ReadTagFile(folder.Write("b.csv",
                               "family,id,x0,y0,z0,x1,y1,z1,x2,y2,z2,x3,y3,z3\n"
                               "tag36h11,7,0.9,2,1.6,1.1,2,1.6,1.1,2,1.4,0.9,2,1.4\n"));
  EXPECT_EQ(by_pose[0].id, 7);
  for (int k = 0; k < 4; ++k) {
    EXPECT_TRUE(by_pose[0].corners_in_site[k].isApprox(by_corners[0].corners_in_site[k], 1e-12));
  }
}

TEST(TagFile, NamesWhatIsWrong) {
  const std::string pose = "family,id,size_m,tx,ty,tz,qx,qy,qz,qw\n";
  const std::pair<std::string, const char*> cases[] = {
      {"family,size_m\n", "family and id"},
      {pose + "tag99,7,0.2,1,2,1,0,0,0,1\n", "line 2: no tag family tag99"},
      {pose + "tag36h11,587,0.2,1,2,1,0,0,0,1\n", "no tag of this id"},
      {pose + "tag36h11,-1,0.2,1,2,1,0,0,0,1\n", "no tag of this id"},
      {pose + "tag36h11,7,0,1,2,1,0,0,0,1\n", "size_m"},
      {pose + "tag36h11,7,0.2,1,2,nan,0,0,0,1\n", "tz is not a number"},
      {pose + "tag36h11,7,0.2,1,2,1,0,0,0,2\n", "quaternion"},
      {pose + "tag36h11,7,0.2,1,2,1,0,0,0,1\ntag36h11,7,0.2,1,2,1,0,0,0,1\n", "line 3: the tag"},
      {"family,id,size_m\ntag36h11,7,0.2\n", "no column called q"},
      {"family,id,x0,y0,z0,x1,y1,z1,x2,y2,z2,x3,y3,z3\ntag36h11,7,0,0,0,1,0,0,1,1,0,0,3,0\n",
       "square"},
  };
  const TempFolder folder;
  for (const auto& [text, cause] : cases) {
    try {
      ReadTagFile(folder.Write("t.csv", text));
      FAIL() << text;
    } catch (const ToolError& error) {
      EXPECT_THAT(error.what(), AllOf(HasSubstr("t.csv"), HasSubstr(cause)));
    }
  }
}

constexpr int kTagPixels = 400;
constexpr double kTagSize = 0.4;  // metres, black border to black border

// A wall of one tag, with its white margin.
cv::Mat Wall(int id) {
  cv::Mat marker;
  cv::aruco::drawMarker(cv::aruco::getPredefinedDictionary(cv::aruco::DICT_APRILTAG_36h11), id,
                        kTagPixels, marker);
  cv::Mat wall;
  cv::copyMakeBorder(marker, wall, 100, 100, 100, 100, cv::BORDER_CONSTANT, 255);
  return wall;
}

// Looks at the tag's middle from x metres aside and 1.5 m in front.
Rigid3 CamFromWall(double x) {
  const Eigen::Vector3d middle(0.3, 0.3, 0);  // in the wall's frame: z points behind it
  const Eigen::Vector3d centre = middle + Eigen::Vector3d(x, 0.1 * x, -1.5);
  const Eigen::Vector3d forward = (middle - centre).normalized();
  const Eigen::Vector3d right = Eigen::Vector3d::UnitY().cross(forward).normalized();
  Eigen::Matrix3d wall_from_cam;
  wall_from_cam << right, forward.cross(right), forward;
  return Inverse({Eigen::Quaterniond(wall_from_cam), centre});
}

// Photographs of the wall, half the size of the camera they are said to be of.
TEST(Tags, GiveControlPointsFromPhotographs) {
  const TempFolder folder;
  const Camera camera = {CameraModel::kPinhole, 640, 480, 600, 600, 319.5, 239.5, {}};
  Reconstruction map;
  map.cameras.push_back(camera.ResizedTo(1280, 960));
  const cv::Mat wall = Wall(7);
  const PlaneRenderer renderer(camera);
  for (const double x : {-0.8, 0.0, 0.7}) {
    MapImage& image = map.images.emplace_back();
    image.name = std::string("wall") + static_cast<char>('a' + map.images.size()) + ".png";
    image.camera_idx = 0;
    image.cam_from_world = CamFromWall(x);
    cv::imwrite(folder / image.name,
                renderer.Render(image.cam_from_world, wall, kTagSize / kTagPixels));
  }
  map.images.push_back(map.images.back());
  map.images.back().name = "missing.png";
  const Tag tag{"tag36h11", 7, {Eigen::Vector3d(0, 0, 5), {1, 0, 5}, {1, -1, 5}, {0, -1, 5}}};
  const Tag absent{"tag36h11", 8, tag.corners_in_site};
  const std::vector<Tag> tags = {absent, tag};
  const auto observations = DetectTags(map, tags, folder.path());
  ASSERT_EQ(observations.size(), 3U);
  const auto pairs = TriangulateTags(map, tags, observations);
  ASSERT_EQ(pairs.size(), 4U);
  EXPECT_EQ(pairs[0].name, "tag36h11 7 corner 0");
  const double a = 0.0995, b = a + kTagSize;  // edges lie half a pixel before the centres
  const Eigen::Vector3d corners[] = {{a, a, 0}, {b, a, 0}, {b, b, 0}, {a, b, 0}};
  for (int k = 0; k < 4; ++k) {
    EXPECT_LT((pairs[k].point_in_map - corners[k]).norm(), 2e-3)
        << k << ": " << pairs[k].point_in_map.transpose();
    EXPECT_EQ(pairs[k].point_in_site, tag.corners_in_site[k]);
  }
}

TEST(Tags, OneWrongRayIsDroppedAndOneRayIsNotEnough) {
  const Camera camera = {CameraModel::kPinhole, 640, 480, 600, 600, 319.5, 239.5, {}};
  Reconstruction map;
  map.cameras.push_back(camera);
  std::vector<TagObservation> observations;
  const Eigen::Vector3d point(0.2, 0.25, 0.05);
  for (int i = 0; i < 6; ++i) {
    map.images.push_back({"", 0, CamFromWall(0.3 * i - 0.8), {}, {}});
    TagObservation seen{i, 0, {}};
    for (Eigen::Vector2d& pixel : seen.corners) {
      ASSERT_TRUE(camera.Project(map.images[i].cam_from_world * point, pixel));
    }
    if (i == 4) seen.corners[2].x() += 60;
    observations.push_back(seen);
  }
  const std::vector<Tag> tags(1);
  const auto pairs = TriangulateTags(map, tags, observations);
  ASSERT_EQ(pairs.size(), 4U);
  for (const ControlPair& pair : pairs) EXPECT_LT((pair.point_in_map - point).norm(), 1e-9);
  EXPECT_TRUE(TriangulateTags(map, tags, std::span(observations).first(1)).empty());
}

}  // namespace
}  // namespace viewfix
