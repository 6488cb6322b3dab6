// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <opencv2/core.hpp>
#include <vector>

#include "engine/geometry/camera.h"
#include "engine/geometry/rigid3.h"

namespace viewfix {

// What a camera sees of a picture on a wall. Every pixel is the mean of `samples` x `samples` rays.
class PlaneRenderer {
 public:
  explicit PlaneRenderer(const Camera& camera, int samples = 3)
      : camera_(camera), rays_per_pixel_(samples * samples) {
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        for (int i = 0; i < rays_per_pixel_; ++i) {
          const Eigen::Vector2d pixel(x + (i % samples + 0.5) / samples - 0.5,
                                      y + (i / samples + 0.5) / samples - 0.5);
          Eigen::Vector3d& bearing = bearings_.emplace_back();
          if (!camera.Unproject(pixel, bearing)) bearing.setZero();
        }
      }
    }
  }

  // `texture` (grey bytes) lies in the plane z = 0, its first pixel's centre at the origin, x
  // along its rows, y down its columns, `pixel_size` metres a pixel; grey around it.
  cv::Mat Render(const Rigid3& cam_from_plane, const cv::Mat& texture, double pixel_size) const {
    const Rigid3 plane_from_cam = Inverse(cam_from_plane);
    const Eigen::Matrix3d rotation = plane_from_cam.rotation.toRotationMatrix();
    cv::Mat image(camera_.height, camera_.width, CV_8U);
    std::size_t at = 0;
    for (std::size_t p = 0; p < image.total(); ++p) {
      double sum = 0;
      for (int i = 0; i < rays_per_pixel_; ++i) {
        sum += Sample(plane_from_cam.translation, rotation * bearings_[at++], texture, pixel_size);
      }
      image.data[p] = cv::saturate_cast<std::uint8_t>(sum / rays_per_pixel_);
    }
    return image;
  }

 private:
  static double Sample(const Eigen::Vector3d& origin, const Eigen::Vector3d& ray,
                       const cv::Mat& texture, double pixel_size) {
    constexpr double kGrey = 180;
    const double depth = -origin.z() / ray.z();
    if (!(depth > 0)) return kGrey;
    const Eigen::Vector3d hit = (origin + depth * ray) / pixel_size;
    const double u = std::floor(hit.x() + 0.5), v = std::floor(hit.y() + 0.5);
    const bool inside = u >= 0 && v >= 0 && u < texture.cols && v < texture.rows;
    return inside ? static_cast<double>(texture.at<std::uint8_t>(int(v), int(u))) : kGrey;
  }

  Camera camera_;
  int rays_per_pixel_;
  std::vector<Eigen::Vector3d> bearings_;  // [height, width, rays_per_pixel_]; zero: none
};

}  // namespace viewfix
