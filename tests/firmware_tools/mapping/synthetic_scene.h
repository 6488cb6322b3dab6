// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <random>
#include <vector>

#include "firmware_tools/mapping/map_input.h"

namespace viewfix {

struct SceneOptions {
  int num_frames = 12;
  int num_points = 400;
  double noise_px = 0.3;
  int clutter = 20;  // key points of each frame that belong to no point
  double readout = 0;  // of a rolling shutter, in frames; the camera's tilt then sways
  unsigned seed = 1;
  std::string capture = "walk";
};

// A camera that walks sideways past points in a box, and what it sees, with the truth.
class SyntheticScene {
 public:
  explicit SyntheticScene(const SceneOptions& options);

  // Key point i of frame f shows points[point_of[f][i]]; -1: clutter.
  std::vector<std::vector<int>> point_of;
  std::vector<Eigen::Vector3d> points;
  std::vector<Rigid3> cam_from_world;
  std::vector<std::unique_ptr<ImageFeatures>> features;
  MapInput input;  // with poses

  MapInput WithoutPoses() const;

 private:
  // At a time in frames.
  static Rigid3 PoseAt(double time, const SceneOptions& options);
  bool See(int frame, const Eigen::Vector3d& point, const SceneOptions& options,
           Eigen::Vector2d& pixel) const;
  void AddFrame(int frame, const SceneOptions& options);
  std::vector<std::int8_t> RandomDescriptor();
  void AddKeypoint(int frame, int point, const Eigen::Vector2d& pixel);

  std::mt19937 random_;
  std::vector<std::vector<std::int8_t>> descriptors_;  // [points]
};

}  // namespace viewfix
