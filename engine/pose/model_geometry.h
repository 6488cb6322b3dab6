// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstdint>

#include "engine/geometry/camera.h"
#include "engine/geometry/rigid3.h"
#include "models/model_view.h"

namespace viewfix {

// What a model's tables say of cameras, poses and landmarks, in the terms of geometry. No heap.

// The camera that frames come from unless told otherwise; width 0: the model names none.
inline Camera CameraOf(const ModelCamera& from) {
  Camera camera;
  if (from.width == 0) return camera;
  camera.model = static_cast<CameraModel>(from.model);
  camera.width = from.width;
  camera.height = from.height;
  camera.fx = from.intrinsics[0];
  camera.fy = from.intrinsics[1];
  camera.cx = from.intrinsics[2];
  camera.cy = from.intrinsics[3];
  std::copy(from.distortion.begin(), from.distortion.end(), camera.distortion.begin());
  return camera;
}

// world_from_cam of a keyframe that has a pose, in its map's frame of reference.
inline Rigid3 KeyframePose(const ModelKeyframes& keyframes, int keyframe_idx) {
  const auto row = keyframes.pose.subspan(std::size_t(keyframe_idx) * 7, 7);
  return {Eigen::Quaterniond(double{row[6]}, double{row[3]}, double{row[4]}, double{row[5]})
              .normalized(),
          Eigen::Vector3d(double{row[0]}, double{row[1]}, double{row[2]})};
}

// A landmark, in its map's frame of reference.
inline Eigen::Vector3d LandmarkPosition(const ModelView& model, std::uint32_t landmark_idx) {
  const ModelLandmarks& landmarks = model.landmarks();
  const int map = model.MapOf(landmark_idx);
  const double step = double{landmarks.map_step[map]};
  Eigen::Vector3d position;
  for (int axis = 0; axis < 3; ++axis) {
    position[axis] = double{landmarks.map_origin[std::size_t(map) * 3 + axis]} +
                     step * landmarks.position[std::size_t(landmark_idx) * 3 + axis];
  }
  return position;
}

}  // namespace viewfix
