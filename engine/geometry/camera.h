// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "engine/base/status.h"

namespace viewfix {

// Values are stored in models: do not change them.
enum class CameraModel : std::uint8_t {
  kPinhole = 1,        // no distortion
  kBrownConrady = 2,   // k1 k2 p1 p2 k3 k4 k5 k6, OpenCV's order (rational where k4..k6 are set)
  kKannalaBrandt = 3,  // k1 k2 k3 k4 of the angle, OpenCV's fisheye
};

// A calibrated camera: x right, y down, z forward; pixel centres at integers. No heap, and no
// function of libm beyond sqrt, so that every processor gives the same bits. Thread-safe.
struct Camera {
  CameraModel model = CameraModel::kPinhole;
  int width = 0;  // pixels
  int height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;  // pixels
  std::array<double, 8> distortion{};     // of the model, zeros behind

  // kInvalidArgument: a size or focal length that is not positive, a number not finite.
  Status Validate() const;

  // The same camera after its image was resized to new_width x new_height (pixel centres at
  // integers: x' + 0.5 = (x + 0.5) * new_width / width).
  Camera ResizedTo(int new_width, int new_height) const;

  // The pixel where a point of camera coordinates is seen. False: it lies behind the camera
  // (a fisheye sees sideways and backwards too, as far as its angle goes), or outside the angle
  // where the distortion is monotonic. `jacobian`, if not null:
  // d pixel / d point_in_cam.
  bool Project(const Eigen::Vector3d& point_in_cam, Eigen::Vector2d& pixel,
               Eigen::Matrix<double, 2, 3>* jacobian = nullptr) const;

  // Unit vector of the ray through a pixel. False: no ray gives this pixel.
  bool Unproject(const Eigen::Vector2d& pixel, Eigen::Vector3d& bearing_in_cam) const;

  friend bool operator==(const Camera&, const Camera&) = default;
};

}  // namespace viewfix
