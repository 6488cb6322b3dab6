// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "engine/geometry/camera.h"

namespace viewfix {

inline Camera PinholeCamera() {
  return {CameraModel::kPinhole, 640, 480, 520, 515, 318.2, 242.9, {}};
}

// One of every model and of the kinds of distortion met in practice.
inline std::vector<Camera> TestCameras() {
  std::vector<Camera> cameras(5, PinholeCamera());
  for (int i = 1; i < 4; ++i) cameras[i].model = CameraModel::kBrownConrady;
  cameras[1].distortion = {-0.28, 0.09, 0.0007, -0.0004, -0.012};
  cameras[2].distortion = {0.12, -0.24, -0.002, 0.003, 0.15};
  cameras[3].distortion = {0.31, 0.04, 0.0002, 0.0003, 0.001, 0.62, 0.12, 0.004};
  cameras[4].model = CameraModel::kKannalaBrandt;
  cameras[4].fx = 285;
  cameras[4].fy = 286;
  cameras[4].distortion = {-0.008, 0.043, -0.039, 0.007};
  return cameras;
}

}  // namespace viewfix
