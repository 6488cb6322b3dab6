// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/simulation/renderer.h"

#include <gtest/gtest.h>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "firmware_tools/simulation/room_builder.h"

namespace viewfix::simulation {
namespace {

const Calibration kCamera = {640, 480, 520, 519, 318.7, 241.2, {-0.11, 0.035, 0, 0}};

// A white dot in the middle of a black wall of 8 x 8 m at y = 4, seen from its front.
Quad WallWithDot(const Eigen::Vector3f& dot) {
  cv::Mat picture = cv::Mat::zeros(1024, 1024, CV_8UC3);
  picture(cv::Rect(508, 508, 8, 8)).setTo(cv::Scalar::all(255));
  Quad wall;
  wall.corner = dot + Eigen::Vector3f(-4, 0, 4);
  wall.right = {8, 0, 0};
  wall.down = {0, 0, -8};
  wall.texture = Bake(picture);
  wall.glow = 1;
  return wall;
}

cv::Point2d Centroid(const cv::Mat& image) {
  double sum = 0;
  double x = 0;
  double y = 0;
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      const double weight = double{image.at<cv::Vec3f>(v, u)[1]};
      sum += weight, x += weight * u, y += weight * v;
    }
  }
  return {x / sum, y / sum};
}

// OpenCV's projection of a world point: the oracle.
cv::Point2d Project(const Eigen::Vector3f& point, const Pose& pose) {
  const Eigen::Vector3d p =
      pose.world_from_cam.conjugate() * (point.cast<double>() - pose.cam_in_world);
  const cv::Matx33d k(kCamera.fx, 0, kCamera.cx, 0, kCamera.fy, kCamera.cy, 0, 0, 1);
  std::vector<cv::Point2d> projected;
  cv::projectPoints(std::vector<cv::Point3d>{{p.x(), p.y(), p.z()}}, cv::Vec3d(), cv::Vec3d(), k,
                    kCamera.distortion, projected);
  return projected[0];
}

class DotInSpace : public ::testing::TestWithParam<Eigen::Vector3f> {};

// Pose, intrinsics, distortion and the half pixel: all of them would show.
TEST_P(DotInSpace, AppearsWhereOpenCvProjectsIt) {
  Scene scene;
  scene.Add(WallWithDot(GetParam()));
  scene.AddLamp({{0, 0, 3}, 1});
  scene.BakeLight();
  Eigen::Matrix3d world_from_cam;  // looks along +y, y down
  world_from_cam << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  const Eigen::AngleAxisd roll(0.3, Eigen::Vector3d::UnitZ());
  const Pose pose = {Eigen::Quaterniond(world_from_cam * roll), {0.1, -0.2, 1.5}};
  const cv::Mat image = Renderer(kCamera).Render(scene, {}, pose, {});
  const cv::Point2d expected = Project(GetParam(), pose);
  const cv::Point2d found = Centroid(image);
  EXPECT_NEAR(found.x, expected.x, 0.2);
  EXPECT_NEAR(found.y, expected.y, 0.2);
}

INSTANTIATE_TEST_SUITE_P(Places, DotInSpace,
                         ::testing::Values(Eigen::Vector3f(0, 4, 1.5f),
                                           Eigen::Vector3f(1.2f, 4, 1.0f),
                                           Eigen::Vector3f(-1.5f, 4, 2.3f),
                                           Eigen::Vector3f(-0.9f, 3, 0.6f)));

TEST(Renderer, NearerThingsHideFartherOnes) {
  Scene scene;
  scene.Add(WallWithDot({0, 4, 1.5f}));
  Quad screen = WallWithDot({0, 2, 1.5f});
  screen.texture = Bake(cv::Mat(16, 16, CV_8UC3, cv::Scalar::all(0)));
  scene.Add(screen);
  scene.BakeLight();
  Eigen::Matrix3d world_from_cam;
  world_from_cam << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  const Pose pose = {Eigen::Quaterniond(world_from_cam), {0, 0, 1.5}};
  const cv::Mat image = Renderer(kCamera).Render(scene, {}, pose, {});
  EXPECT_LT(cv::sum(image)[1], 1.0);
}

}  // namespace
}  // namespace viewfix::simulation
