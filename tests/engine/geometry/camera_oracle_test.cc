// SPDX-License-Identifier: BSD-3-Clause
// The camera models beside OpenCV's.
#include <gtest/gtest.h>

#include <opencv2/calib3d.hpp>
#include <random>

#include "tests/engine/geometry/test_cameras.h"

namespace viewfix {
namespace {

std::vector<cv::Point3d> PointsInView(const Camera& camera) {
  std::mt19937 random(3);
  std::vector<cv::Point3d> points;
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector2d pixel(random() % camera.width, random() % camera.height);
    Eigen::Vector3d bearing;
    EXPECT_TRUE(camera.Unproject(pixel, bearing));
    bearing *= 1 + static_cast<double>(random() % 100) / 20;
    points.emplace_back(bearing.x(), bearing.y(), bearing.z());
  }
  return points;
}

std::vector<cv::Point2d> ProjectWithOpenCv(const Camera& camera,
                                           const std::vector<cv::Point3d>& points) {
  const cv::Matx33d k(camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
  const cv::Vec3d zero(0, 0, 0);
  std::vector<cv::Point2d> pixels;
  const bool fisheye = camera.model == CameraModel::kKannalaBrandt;
  const cv::Mat d(1, fisheye ? 4 : 8, CV_64F, const_cast<double*>(camera.distortion.data()));
  if (fisheye) {
    cv::fisheye::projectPoints(points, pixels, zero, zero, k, d);
  } else {
    cv::projectPoints(points, zero, zero, k, d, pixels);
  }
  return pixels;
}

TEST(CameraOracle, ProjectsAsOpenCvDoes) {
  for (const Camera& camera : TestCameras()) {
    const auto points = PointsInView(camera);
    const auto expected = ProjectWithOpenCv(camera, points);
    for (std::size_t i = 0; i < points.size(); ++i) {
      Eigen::Vector2d pixel;
      ASSERT_TRUE(camera.Project({points[i].x, points[i].y, points[i].z}, pixel));
      EXPECT_NEAR(pixel.x(), expected[i].x, 1e-9);
      EXPECT_NEAR(pixel.y(), expected[i].y, 1e-9);
    }
  }
}

}  // namespace
}  // namespace viewfix
