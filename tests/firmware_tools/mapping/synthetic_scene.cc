// SPDX-License-Identifier: BSD-3-Clause
#include "tests/firmware_tools/mapping/synthetic_scene.h"

#include <algorithm>
#include <cmath>

namespace viewfix {
namespace {

constexpr int kDim = 64;
constexpr Camera MakeCamera() {
  return {.width = 640, .height = 480, .fx = 500, .fy = 500, .cx = 319.5, .cy = 239.5};
}

}  // namespace

SyntheticScene::SyntheticScene(const SceneOptions& options) : random_(options.seed) {
  std::uniform_real_distribution<double> x(-4, 4), y(-1.5, 1.5), z(3, 7);
  for (int p = 0; p < options.num_points; ++p) {
    points.emplace_back(x(random_), y(random_), z(random_));
    descriptors_.push_back(RandomDescriptor());
  }
  input.cameras.push_back(MakeCamera());
  for (int f = 0; f < options.num_frames; ++f) AddFrame(f, options);
}

Rigid3 SyntheticScene::PoseAt(double time, const SceneOptions& options) {
  const double share = time / std::max(1, options.num_frames - 1) - 0.5;
  const double sway = options.readout > 0 ? 0.1 * std::sin(0.7 * time) : 0;
  const Eigen::Quaterniond turn = Eigen::AngleAxisd(sway, Eigen::Vector3d::UnitX()) *
                                  Eigen::AngleAxisd(0.5 * share, Eigen::Vector3d::UnitY());
  const Eigen::Vector3d center(3 * share, 0.2 * std::sin(9 * share), 0.3 * share);
  return {turn, -(turn * center)};
}

bool SyntheticScene::See(int frame, const Eigen::Vector3d& point, const SceneOptions& options,
                         Eigen::Vector2d& pixel) const {
  const Camera& camera = input.cameras[0];
  if (!camera.Project(cam_from_world[frame] * point, pixel)) return false;
  for (int round = 0; options.readout > 0 && round < 4; ++round) {
    const double row = (pixel.y() - 0.5 * (camera.height - 1)) / camera.height;
    const Rigid3 pose = PoseAt(frame + options.readout * row, options);
    if (!camera.Project(pose * point, pixel)) return false;
  }
  return true;
}

void SyntheticScene::AddFrame(int frame, const SceneOptions& options) {
  cam_from_world.push_back(PoseAt(frame, options));
  point_of.emplace_back();
  features.push_back(std::make_unique<ImageFeatures>());
  const Camera& camera = input.cameras[0];
  features.back()->width = camera.width;
  features.back()->height = camera.height;
  std::normal_distribution<double> noise(0, options.noise_px);
  for (int p = 0; p < static_cast<int>(points.size()); ++p) {
    Eigen::Vector2d pixel;
    if (!See(frame, points[p], options, pixel)) continue;
    pixel += Eigen::Vector2d(noise(random_), noise(random_));
    if (pixel.x() < 0 || pixel.y() < 0 || pixel.x() > 639 || pixel.y() > 479) continue;
    AddKeypoint(frame, p, pixel);
  }
  for (int c = 0; c < options.clutter; ++c) {
    AddKeypoint(frame, -1, {double(random_() % 640), double(random_() % 480)});
  }
  input.frames.push_back({.name = "frame" + std::to_string(100 + frame) + ".jpg",
                          .capture = options.capture,
                          .time = double(frame),
                          .camera_idx = 0,
                          .features = features.back().get(),
                          .cam_from_world = cam_from_world.back()});
}

std::vector<std::int8_t> SyntheticScene::RandomDescriptor() {
  std::normal_distribution<double> entry(0, 127 / std::sqrt(double(kDim)));
  std::vector<std::int8_t> descriptor(kDim);
  for (std::int8_t& d : descriptor) {
    d = static_cast<std::int8_t>(std::clamp(std::lround(entry(random_)), -127L, 127L));
  }
  return descriptor;
}

void SyntheticScene::AddKeypoint(int frame, int point, const Eigen::Vector2d& pixel) {
  ImageFeatures& image = *features[frame];
  image.keypoints.push_back({.x = static_cast<float>(pixel.x()),
                             .y = static_cast<float>(pixel.y()),
                             .sigma = 2,
                             .response = 1});
  for (const std::int8_t d : point < 0 ? RandomDescriptor() : descriptors_[point]) {
    const int noisy = d + static_cast<int>(random_() % 7) - 3;
    image.descriptors.push_back(static_cast<std::int8_t>(std::clamp(noisy, -127, 127)));
  }
  point_of[frame].push_back(point);
}

MapInput SyntheticScene::WithoutPoses() const {
  MapInput without = input;
  for (MapFrame& frame : without.frames) frame.cam_from_world.reset();
  return without;
}

}  // namespace viewfix
