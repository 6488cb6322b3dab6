// SPDX-License-Identifier: BSD-3-Clause
#include "engine/geometry/camera.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "tests/engine/geometry/test_cameras.h"

namespace viewfix {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

TEST(Camera, UnprojectUndoesProject) {
  for (const Camera& camera : TestCameras()) {
    for (int x = 0; x < camera.width; x += 13) {
      for (int y = 0; y < camera.height; y += 11) {
        Vector3d bearing;
        Vector2d pixel;
        ASSERT_TRUE(camera.Unproject(Vector2d(x, y), bearing)) << x << " " << y;
        EXPECT_NEAR(bearing.norm(), 1, 1e-14);
        ASSERT_TRUE(camera.Project(3.7 * bearing, pixel));
        EXPECT_LT((pixel - Vector2d(x, y)).norm(), 1e-6);
      }
    }
  }
}

TEST(Camera, JacobianIsTheNumericOne) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (const Camera& camera : TestCameras()) {
    for (int i = 0; i < 200; ++i) {
      const Vector3d point(0.5 * unit(random), 0.5 * unit(random), 1.5 + unit(random));
      Eigen::Matrix<double, 2, 3> jacobian;
      Vector2d pixel;
      ASSERT_TRUE(camera.Project(point, pixel, &jacobian));
      for (int axis = 0; axis < 3; ++axis) {
        const Vector3d step = 1e-6 * Vector3d::Unit(axis);
        Vector2d after, before;
        ASSERT_TRUE(camera.Project(point + step, after));
        ASSERT_TRUE(camera.Project(point - step, before));
        EXPECT_LT((jacobian.col(axis) - (after - before) / 2e-6).norm(), 1e-4);
      }
    }
  }
}

TEST(Camera, AFisheyeSeesBehindItself) {
  Camera camera = TestCameras()[4];
  camera.distortion = {};
  for (const double z : {0.5, 0.0, -0.5}) {
    const Vector3d point = Vector3d(0.6, 0.8, z).normalized();
    Vector2d pixel;
    Vector3d bearing;
    ASSERT_TRUE(camera.Project(point, pixel));
    ASSERT_TRUE(camera.Unproject(pixel, bearing));
    EXPECT_LT((bearing - point).norm(), 1e-9);
  }
  Vector2d pixel;
  EXPECT_FALSE(camera.Project(Vector3d(0, 0, -1), pixel));
}

TEST(Camera, PointsBehindAreNotSeen) {
  for (const Camera& camera : TestCameras()) {
    Vector2d pixel;
    EXPECT_FALSE(camera.Project(Vector3d(0, 0, -2), pixel));
    EXPECT_FALSE(camera.Project(Vector3d(0, 0, 0), pixel));
  }
}

// r (1 - 0.5 r^2 + 0.1 r^4) falls between r = 1 and 1.41, then grows again.
TEST(Camera, NothingIsSeenBeyondTheFoldOfTheDistortion) {
  Camera camera = PinholeCamera();
  camera.model = CameraModel::kBrownConrady;
  camera.distortion = {-0.5, 0.1};
  Vector2d pixel;
  EXPECT_TRUE(camera.Project(Vector3d(0.98, 0, 1), pixel));
  for (const double r : {1.05, 1.3, 1.45, 2.0, 5.0}) {
    EXPECT_FALSE(camera.Project(Vector3d(r, 0, 1), pixel)) << r;
  }
  Vector3d bearing;
  EXPECT_TRUE(camera.Unproject(Vector2d(camera.cx + 0.59 * camera.fx, camera.cy), bearing));
  EXPECT_LT(bearing.x() / bearing.z(), 1);
  EXPECT_FALSE(camera.Unproject(Vector2d(camera.cx + 0.62 * camera.fx, camera.cy), bearing));
}

TEST(Camera, ResizingMovesPixelsWithTheImage) {
  for (const Camera& camera : TestCameras()) {
    const Camera half = camera.ResizedTo(320, 160);
    const Vector3d point(0.2, -0.15, 1.1);
    Vector2d pixel, small;
    ASSERT_TRUE(camera.Project(point, pixel));
    ASSERT_TRUE(half.Project(point, small));
    EXPECT_NEAR(small.x() + 0.5, (pixel.x() + 0.5) / 2, 1e-10);
    EXPECT_NEAR(small.y() + 0.5, (pixel.y() + 0.5) / 3, 1e-10);
    EXPECT_EQ(half.ResizedTo(640, 480).fx, camera.fx);
  }
}

TEST(Camera, ValidateNamesWhatIsWrong) {
  for (const Camera& camera : TestCameras()) EXPECT_TRUE(camera.Validate().ok());
  const auto broken = [](auto change) {
    Camera camera = PinholeCamera();
    change(camera);
    return camera.Validate().code() == StatusCode::kInvalidArgument;
  };
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(broken([](Camera& c) { c.width = 0; }));
  EXPECT_TRUE(broken([](Camera& c) { c.height = -1; }));
  EXPECT_TRUE(broken([](Camera& c) { c.fx = 0; }));
  EXPECT_TRUE(broken([](Camera& c) { c.fy = -2; }));
  EXPECT_TRUE(broken([](Camera& c) { c.cx = kNan; }));
  EXPECT_TRUE(broken([](Camera& c) { c.distortion[7] = kNan; }));
  EXPECT_TRUE(broken([](Camera& c) { c.model = static_cast<CameraModel>(9); }));
}

// Wild coefficients and points: an answer or none, but a finite one that is right.
TEST(Camera, HostileParametersGiveNoWrongAnswer) {
  std::mt19937 random(2);
  std::normal_distribution<double> normal(0, 1);
  int seen = 0;
  for (int i = 0; i < 20000; ++i) {
    Camera camera = PinholeCamera();
    camera.model = i % 2 ? CameraModel::kBrownConrady : CameraModel::kKannalaBrandt;
    for (double& k : camera.distortion) k = normal(random) * (i % 5 == 0 ? 100 : 1);
    Vector3d bearing;
    const Vector2d pixel(400 * normal(random), 400 * normal(random));
    if (!camera.Unproject(pixel, bearing)) continue;
    Vector2d again;
    ASSERT_TRUE(bearing.allFinite());
    ASSERT_TRUE(camera.Project(bearing, again));
    EXPECT_LT((again - pixel).norm(), 1e-5);
    ++seen;
  }
  EXPECT_GT(seen, 1000);
}

TEST(Camera, NumbersThatAreNoneGiveNoAnswer) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  for (const Camera& camera : TestCameras()) {
    Vector2d pixel;
    Vector3d bearing;
    EXPECT_FALSE(camera.Project(Vector3d(kNan, 0, 1), pixel));
    EXPECT_FALSE(camera.Project(Vector3d(0, 0, kNan), pixel));
    EXPECT_FALSE(camera.Unproject(Vector2d(kNan, 0), bearing));
    EXPECT_FALSE(camera.Unproject(Vector2d(0, std::numeric_limits<double>::infinity()), bearing));
  }
}

}  // namespace
}  // namespace viewfix
