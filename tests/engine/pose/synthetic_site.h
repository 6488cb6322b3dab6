// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "engine/features/feature_extractor.h"
#include "engine/geometry/camera.h"
#include "engine/geometry/rigid3.h"
#include "models/model_writer.h"
#include "tests/testing/tiny_model.h"

namespace viewfix {

// What a camera sees of a synthetic site.
struct SightOptions {
  double noise_px = 0.4;  // of each coordinate
  int clutter = 60;       // key points that show no landmark
  double share_seen = 0.7;
};

// A model of landmarks in a box, without an image: random descriptors, and eight keyframes that
// walk sideways along it. With two maps the second has landmarks of its own in a box of the same
// size, and the last four keyframes.
class SyntheticSite {
 public:
  static constexpr int kDim = 64;
  static constexpr int kKeyframes = 8;
  static constexpr int kMaxFeatures = 800;

  explicit SyntheticSite(int num_maps = 1, int landmarks_per_map = 500, unsigned seed = 1)
      : random_(seed), data_(TinyModelData()) {
    data_.features.max_features = kMaxFeatures;
    data_.camera = {.model = 1,
                    .width = camera().width,
                    .height = camera().height,
                    .intrinsics = {camera().fx, camera().fy, camera().cx, camera().cy},
                    .distortion = {}};
    data_.pixel_sigma = 0.25F;
    data_.map_begin = {0};
    for (int map = 0; map < num_maps; ++map) AddMap(landmarks_per_map);
    AddKeyframes(num_maps);
  }

  static Camera camera() {
    return {.width = 640, .height = 480, .fx = 500, .fy = 500, .cx = 319.5, .cy = 239.5};
  }

  // Gives every landmark colours of its own.
  void Colour() {
    data_.landmark_chroma.resize(data_.landmark_position.size() * kLandmarkChromaDim);
    for (std::int8_t& step : data_.landmark_chroma) {
      step = static_cast<std::int8_t>(static_cast<int>(random_() % 9) - 4);
    }
  }

  // Where the camera of keyframe k, or of a place between two, stands.
  static Rigid3 CamFromWorld(double k) {
    const double share = k / (kKeyframes - 1) - 0.5;
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.4 * share, Eigen::Vector3d::UnitY()));
    return Inverse(Rigid3{turn, Eigen::Vector3d(2 * share, 0.1 * share, 0.2 * share)});
  }

  ModelData& data() { return data_; }
  std::vector<std::uint8_t> File() const { return *WriteModel(data_); }
  std::mt19937& random() { return random_; }

  FeatureSet See(const Camera& through, const Rigid3& cam_from_world, int map,
                 const SightOptions& options = {}) {
    FeatureSet features(kMaxFeatures, kDim);
    features.set_has_chroma(!data_.landmark_chroma.empty());
    std::uniform_real_distribution<double> unit(0, 1);
    std::normal_distribution<double> noise(0, options.noise_px);
    for (std::uint32_t l = data_.map_begin[map]; l < data_.map_begin[map + 1]; ++l) {
      Eigen::Vector2d pixel;
      const bool seen =
          through.Project(cam_from_world * Position(l), pixel) && Inside(through, pixel);
      if (!seen || unit(random_) > options.share_seen) continue;
      pixel += Eigen::Vector2d(noise(random_), noise(random_));
      Append(pixel, &data_.landmark_descriptors[std::size_t(l) * kDim], features);
      for (int i = 0; features.has_chroma() && i < kLandmarkChromaDim; ++i) {
        features.mutable_chroma(features.size() - 1)[i] = static_cast<std::int8_t>(
            kLandmarkChromaStep * data_.landmark_chroma[std::size_t(l) * kLandmarkChromaDim + i]);
      }
    }
    for (int i = 0; i < options.clutter; ++i) {
      const auto descriptor = RandomDescriptor();
      Append({unit(random_) * through.width, unit(random_) * through.height}, descriptor.data(),
             features);
    }
    return features;
  }

 private:
  static bool Inside(const Camera& camera, const Eigen::Vector2d& pixel) {
    return pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() <= camera.width - 1 &&
           pixel.y() <= camera.height - 1;
  }

  Eigen::Vector3d Position(std::uint32_t l) const {
    const auto map = std::upper_bound(data_.map_begin.begin(), data_.map_begin.end(), l) -
                     data_.map_begin.begin() - 1;
    Eigen::Vector3d position;
    for (int axis = 0; axis < 3; ++axis) {
      position[axis] = double{data_.map_origin[map][axis]} +
                       double{data_.map_step[map]} * data_.landmark_position[l][axis];
    }
    return position;
  }

  void AddMap(int num_landmarks) {
    data_.map_origin.push_back({0, 0, 5});
    data_.map_step.push_back(4.0F / 32767);
    for (int l = 0; l < num_landmarks; ++l) {
      std::array<std::int16_t, 3> position;
      const int half[] = {32767, 13000, 16000};
      for (int axis = 0; axis < 3; ++axis) {
        position[axis] =
            static_cast<std::int16_t>(static_cast<int>(random_() % (2 * half[axis])) - half[axis]);
      }
      data_.landmark_position.push_back(position);
      data_.landmark_laplacian_sign.push_back(1);
      data_.landmark_rarity.push_back(255);
      const auto descriptor = RandomDescriptor();
      data_.landmark_descriptors.insert(data_.landmark_descriptors.end(), descriptor.begin(),
                                        descriptor.end());
    }
    data_.map_begin.push_back(static_cast<std::uint32_t>(data_.landmark_position.size()));
  }

  void AddKeyframes(int num_maps) {
    data_.keyframe_landmark_begin = {0};
    for (int k = 0; k < kKeyframes; ++k) {
      const int map = k * num_maps / kKeyframes;
      const Rigid3 cam_from_world = CamFromWorld(k);
      for (std::uint32_t l = data_.map_begin[map]; l < data_.map_begin[map + 1]; ++l) {
        Eigen::Vector2d pixel;
        const bool seen = camera().Project(cam_from_world * Position(l), pixel);
        if (seen && Inside(camera(), pixel)) data_.keyframe_landmarks.push_back(l);
      }
      data_.keyframe_landmark_begin.push_back(
          static_cast<std::uint32_t>(data_.keyframe_landmarks.size()));
      SetPose(k, Inverse(cam_from_world));
    }
  }

  void SetPose(int k, const Rigid3& world_from_cam) {
    const auto t = world_from_cam.translation.cast<float>().eval();
    const auto q = world_from_cam.rotation.cast<float>();
    data_.keyframe_has_pose[k] = 1;
    data_.keyframe_pose[k] = {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()};
  }

  std::vector<std::int8_t> RandomDescriptor() {
    std::normal_distribution<double> entry(0, 127 / std::sqrt(double{kDim}));
    std::vector<std::int8_t> descriptor(kDim);
    for (std::int8_t& d : descriptor) {
      d = static_cast<std::int8_t>(std::clamp(std::lround(entry(random_)), -127L, 127L));
    }
    return descriptor;
  }

  void Append(const Eigen::Vector2d& pixel, const std::int8_t* descriptor, FeatureSet& features) {
    if (features.size() == features.capacity()) return;
    Keypoint keypoint;
    keypoint.x = static_cast<float>(pixel.x());
    keypoint.y = static_cast<float>(pixel.y());
    keypoint.sigma = 2;
    const auto row = features.mutable_descriptor(features.Append(keypoint));
    for (int d = 0; d < kDim; ++d) {
      const int noisy = descriptor[d] + static_cast<int>(random_() % 7) - 3;
      row[d] = static_cast<std::int8_t>(std::clamp(noisy, -127, 127));
    }
  }

  std::mt19937 random_;
  ModelData data_;
};

}  // namespace viewfix
