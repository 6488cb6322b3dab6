// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "engine/geometry/camera.h"
#include "engine/geometry/rigid3.h"

namespace viewfix {

// How points move in a camera's frame while it walks, per frame of the walk.
struct ShutterMotion {
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();   // rotation vector
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();  // world units

  Eigen::Vector3d OfPoint(const Eigen::Vector3d& in_cam) const {
    return turn.cross(in_cam) + shift;
  }
};

// One photograph of a reconstruction.
struct MapImage {
  std::string name;     // path relative to the image set's folder
  int camera_idx = -1;  // into Reconstruction::cameras
  Rigid3 cam_from_world;
  std::vector<Eigen::Vector2d> keypoints;  // pixels of the camera, centres at integers
  std::vector<int> point_idx;              // [keypoints] into Reconstruction::points; -1: none
  // Of a rolling shutter (rolling_shutter.h): how the camera moved, and the readout that the key
  // points have been rid of.
  ShutterMotion motion = {};
  double readout = 0;
};

struct Observation {
  int image_idx = 0;    // into Reconstruction::images
  int feature_idx = 0;  // into that image's keypoints

  friend bool operator==(const Observation&, const Observation&) = default;
};

// A 3D point and the key points that see it, at most one an image.
struct MapPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // world units
  double error_px = 0;                                 // mean reprojection error
  std::vector<Observation> track;                      // by image_idx
};

// What SfM, or triangulation under known poses, makes of photographs: one connected map.
// COLMAP's half pixel is added and removed where its files are read and written; in here
// pixel centres stand at integers.
struct Reconstruction {
  std::vector<Camera> cameras;
  std::vector<MapImage> images;  // registered ones only
  std::vector<MapPoint> points;
};

}  // namespace viewfix
