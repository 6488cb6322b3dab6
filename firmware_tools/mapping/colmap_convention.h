// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace viewfix {

// COLMAP, and nerfstudio after it, put the centre of the first pixel at (0.5, 0.5); Viewfix and
// OpenCV at (0, 0). Key points and principal points pass through here, and nowhere else.
inline constexpr double kColmapPixelCentre = 0.5;

inline Eigen::Vector2d ToColmapPixel(const Eigen::Vector2d& pixel) {
  return pixel.array() + kColmapPixelCentre;
}

inline Eigen::Vector2d FromColmapPixel(const Eigen::Vector2d& colmap_pixel) {
  return colmap_pixel.array() - kColmapPixelCentre;
}

}  // namespace viewfix
