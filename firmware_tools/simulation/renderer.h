// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/simulation/scene.h"

namespace viewfix::simulation {

// How bright the room is in one frame.
struct Illumination {
  float skylight = 0.55f;  // light from everywhere
  float lamps = 1.0f;      // light of the lamps, with shadows
};

// Casts 2x2 rays a pixel through a camera with Brown-Conrady distortion
// (k1, k2; pixel centres at integers). The rays are computed once, so make one and
// share it: Render is const and thread-safe.
//
// Rays go in packets of 8x8 pixels. A packet is tested against the rectangles that
// its frustum touches, all rays of a packet against one rectangle at a time.
class Renderer {
 public:
  explicit Renderer(const Calibration& calibration);

  // Linear-light BGR float image. `visitors`: rectangles of this frame alone,
  // lit evenly.
  cv::Mat Render(const Scene& scene, std::span<const Quad> visitors, const Pose& pose,
                 const Illumination& illumination) const;

 private:
  struct Packet;
  struct Prepared;
  std::vector<int> Cull(const std::vector<Prepared>& quads, std::span<const int> candidates,
                        const Eigen::Matrix3f& world_from_cam, cv::Rect pixels) const;
  void RenderPacket(const std::vector<Prepared>& quads, std::span<const int> candidates,
                    const Eigen::Matrix3f& world_from_cam, const Illumination& illumination,
                    cv::Point at, cv::Mat& image) const;

  int width_, height_;
  float pixel_angle_;                 // radians a pixel at the image centre
  std::vector<float> ray_x_, ray_y_;  // of each ray (x, y, 1) in the camera, packet after packet
  std::vector<Eigen::Vector2f> corner_rays_;  // through corners of 8x8 pixels, row by row
};

}  // namespace viewfix::simulation
