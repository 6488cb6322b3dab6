// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <random>
#include <string>

#include "firmware_tools/mapping/reconstruction.h"

namespace viewfix {

// Pixel of a point by the textbook: Brown-Conrady (k1 k2 p1 p2) or Kannala-Brandt. In front only.
inline Eigen::Vector2d TextbookPixel(const Camera& c, const Eigen::Vector3d& p) {
  double x = p.x() / p.z(), y = p.y() / p.z();
  const auto& k = c.distortion;
  const double r2 = x * x + y * y;
  if (c.model == CameraModel::kBrownConrady) {
    const double radial = 1 + k[0] * r2 + k[1] * r2 * r2;
    const double dx = x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x);
    const double dy = y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y;
    x = dx, y = dy;
  } else if (c.model == CameraModel::kKannalaBrandt) {
    const double r = std::sqrt(r2), t = std::atan(r), t2 = t * t;
    const double scale = t * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3])))) / r;
    x *= scale, y *= scale;
  }
  return {c.fx * x + c.cx, c.fy * y + c.cy};
}

// A pose that looks at the origin from a circle of 5 units, x axis level, z of the world up.
inline Rigid3 PoseOnCircle(double angle, double height) {
  const Eigen::Vector3d centre(5 * std::cos(angle), 5 * std::sin(angle), height);
  const Eigen::Vector3d forward = -centre.normalized();
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d world_from_cam;
  world_from_cam << right, forward.cross(right), forward;
  return Inverse({Eigen::Quaterniond(world_from_cam), centre});
}

// 12 images by three cameras (one of each model) around 60 points that all of them see.
inline Reconstruction SyntheticMap(unsigned seed) {
  Reconstruction map;
  map.cameras = {
      {CameraModel::kPinhole, 640, 480, 500, 510, 319.25, 238.75, {}},
      {CameraModel::kBrownConrady, 800, 600, 600, 601, 401.5, 299.5, {-0.1, 0.02, 1e-3, -2e-3}},
      {CameraModel::kKannalaBrandt, 640, 640, 300, 301, 320, 319, {0.02, -0.01, 1e-3, 1e-4}}};
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int i = 0; i < 60; ++i) {
    MapPoint& point = map.points.emplace_back();
    point.position = {uniform(random), uniform(random), uniform(random)};
  }
  for (int i = 0; i < 12; ++i) {
    MapImage& image = map.images.emplace_back();
    image.name = std::string("walk/") + static_cast<char>('a' + i) + ".jpg";
    image.camera_idx = i % 3;
    image.cam_from_world = PoseOnCircle(0.5 * i, 0.3 * uniform(random));
    image.keypoints.push_back({17, 18.5});  // of no point
    image.point_idx.push_back(-1);
    for (int p = 0; p < 60; ++p) {
      const Eigen::Vector3d in_cam = image.cam_from_world * map.points[p].position;
      map.points[p].track.push_back({i, static_cast<int>(image.keypoints.size())});
      image.keypoints.push_back(TextbookPixel(map.cameras[image.camera_idx], in_cam));
      image.point_idx.push_back(p);
    }
  }
  return map;
}

}  // namespace viewfix
