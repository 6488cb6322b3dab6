// SPDX-License-Identifier: BSD-3-Clause
#include "tests/testing/landmark_site.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>

#include "engine/features/feature_extractor.h"
#include "tests/testing/tiny_model.h"

namespace viewfix {
namespace {

constexpr float kStep = 1e-3F;

// Blocks of random grey: corners and blobs all over.
std::vector<std::uint8_t> Blocks(int width, int height) {
  std::mt19937 random(5);
  std::vector<std::uint8_t> cells(64 * 64);
  for (auto& cell : cells) cell = static_cast<std::uint8_t>(random());
  std::vector<std::uint8_t> pixels;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) pixels.push_back(cells[y / 9 % 64 * 64 + x / 9 % 64]);
  }
  return pixels;
}

FeatureSet Extract(const LandmarkSite& site) {
  const ModelFeatures& f = site.data.features;
  auto extractor = CreateFeatureExtractor({.type = static_cast<FeatureType>(f.type),
                                           .max_image_side = f.max_image_side,
                                           .max_features = f.max_features,
                                           .upright = f.upright,
                                           .threshold = f.threshold});
  FeatureSet features(f.max_features, f.descriptor_dim);
  const ImageView image = {site.pixels.data(), site.width, site.height, site.width};
  if (!extractor.ok() || !(*extractor)->Extract(image, features).ok() || features.size() < 100) {
    std::fprintf(stderr, "landmark site: no features\n");
    std::abort();
  }
  return features;
}

void AddLandmarks(const FeatureSet& features, const LandmarkSite& site, ModelData& data) {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> depth(2, 6);
  for (int i = 0; i < features.size(); ++i) {
    const Keypoint& keypoint = features.keypoints()[i];
    Eigen::Vector3d bearing;
    (void)site.camera.Unproject({keypoint.x, keypoint.y}, bearing);
    const Eigen::Vector3d point = site.world_from_cam * (depth(random) * bearing);
    std::array<std::int16_t, 3> position;
    for (int axis = 0; axis < 3; ++axis) {
      position[axis] = static_cast<std::int16_t>(std::lround(point[axis] / double{kStep}));
    }
    data.landmark_position.push_back(position);
    data.landmark_laplacian_sign.push_back(keypoint.laplacian_sign);
    data.landmark_rarity.push_back(255);
  }
  data.landmark_descriptors.assign(features.descriptors().begin(), features.descriptors().end());
}

}  // namespace

LandmarkSite MakeLandmarkSite() {
  LandmarkSite site;
  site.data = TinyModelData();
  site.pixels = Blocks(site.width, site.height);
  site.camera = {
      .width = site.width, .height = site.height, .fx = 280, .fy = 280, .cx = 159.5, .cy = 119.5};
  site.world_from_cam = {Eigen::Quaterniond(0.9, 0.1, -0.4, 0.1).normalized(),
                         Eigen::Vector3d(1, -2, 0.5)};
  AddLandmarks(Extract(site), site, site.data);
  ModelData& data = site.data;
  const auto size = static_cast<std::uint32_t>(data.landmark_position.size());
  data.camera = {.model = 1,
                 .width = site.width,
                 .height = site.height,
                 .intrinsics = {site.camera.fx, site.camera.fy, site.camera.cx, site.camera.cy},
                 .distortion = {}};
  data.map_begin = {0, size};
  data.map_origin = {{0, 0, 0}};
  data.map_step = {kStep};
  data.pixel_sigma = 0.2F;
  data.keyframe_landmark_begin = {0};
  for (std::uint32_t k = 0; k < data.keyframe_pair.size(); ++k) {
    const std::uint32_t part = k / 2;
    for (std::uint32_t l = 0; k % 2 == 0 && l < size; ++l) {
      if (l % 4 != part) data.keyframe_landmarks.push_back(l);
    }
    data.keyframe_landmark_begin.push_back(
        static_cast<std::uint32_t>(data.keyframe_landmarks.size()));
  }
  return site;
}

}  // namespace viewfix
