// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/model_map.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <vector>

#include "engine/vocabulary/vocabulary.h"
#include "firmware_tools/common/parallel.h"

namespace viewfix {
namespace {

// Cells of an image over which a keyframe's landmarks are spread.
constexpr int kColumns = 6;
constexpr int kRows = 4;

constexpr float kDescriptorLength = 127;

// Rarity: words whose landmarks are compared; the distance below which descriptors, of length
// 127, look alike; and what share of a map's extent is elsewhere.
constexpr int kRarityWords = 3;
constexpr int kAlike = 45;
constexpr double kElsewhere = 0.05;

// Median of a Rayleigh distribution of unit sigma.
constexpr double kRayleighMedian = 1.1774;

int CellOf(const Camera& camera, const Eigen::Vector2d& pixel) {
  const int column = static_cast<int>(pixel.x() * kColumns / camera.width);
  const int row = static_cast<int>(pixel.y() * kRows / camera.height);
  return std::clamp(row, 0, kRows - 1) * kColumns + std::clamp(column, 0, kColumns - 1);
}

// Points in the order in which they are taken: seen often, then precise.
std::vector<int> ByWorth(const Reconstruction& map, const ModelMapOptions& options) {
  std::vector<int> order;
  for (int p = 0; p < static_cast<int>(map.points.size()); ++p) {
    const MapPoint& point = map.points[p];
    const bool stable = static_cast<int>(point.track.size()) >= options.min_track &&
                        point.error_px <= options.max_error_px;
    if (stable) order.push_back(p);
  }
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    const MapPoint& first = map.points[a];
    const MapPoint& second = map.points[b];
    if (first.track.size() != second.track.size()) return first.track.size() > second.track.size();
    return first.error_px < second.error_px;
  });
  return order;
}

// Greedy cover: a point is kept while one of the keyframes that see it has too few there. What only
// other images see, of a walk without labels say, nothing would propose.
std::vector<int> ChoosePoints(const Reconstruction& map, const std::set<std::string>& keyframes,
                              const ModelMapOptions& options) {
  const int quota = (options.landmarks_per_keyframe + kColumns * kRows - 1) / (kColumns * kRows);
  std::vector<std::vector<int>> count(map.images.size(), std::vector<int>(kColumns * kRows, 0));
  std::vector<bool> is_keyframe;
  for (const MapImage& image : map.images) is_keyframe.push_back(keyframes.contains(image.name));
  std::vector<int> chosen;
  for (const int p : ByWorth(map, options)) {
    bool wanted = false;
    const auto cell = [&](const Observation& o) -> int& {
      const MapImage& image = map.images[o.image_idx];
      return count[o.image_idx]
                  [CellOf(map.cameras[image.camera_idx], image.keypoints[o.feature_idx])];
    };
    for (const Observation& o : map.points[p].track) {
      wanted = wanted || (is_keyframe[o.image_idx] && cell(o) < quota);
    }
    if (!wanted) continue;
    for (const Observation& o : map.points[p].track) ++cell(o);
    chosen.push_back(p);
  }
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

class Writer {
 public:
  Writer(const ImageSet& set, const FeatureStore& features,
         std::span<const int> keyframe_image_idxs, int jobs, ModelData& model)
      : features_(features), jobs_(jobs), model_(model) {
    for (int i = 0; i < static_cast<int>(set.images.size()); ++i) idx_of_[set.images[i].path] = i;
    for (int k = 0; k < static_cast<int>(keyframe_image_idxs.size()); ++k) {
      keyframe_of_[keyframe_image_idxs[k]] = k;
    }
    seen_.resize(keyframe_image_idxs.size());
    model_.map_begin = {0};
  }

  void AddMap(const Reconstruction& map, const std::vector<int>& chosen) {
    AddFrame(map, chosen);
    for (const int p : chosen) AddLandmark(map, map.points[p]);
    model_.map_begin.push_back(static_cast<std::uint32_t>(model_.landmark_position.size()));
    for (const MapImage& image : map.images) GivePose(image);
  }

  void Finish(const Reconstruction& largest) {
    if (!any_chroma_) model_.landmark_chroma.clear();
    WeighByRarity();
    model_.keyframe_landmark_begin = {0};
    for (std::vector<std::uint32_t>& seen : seen_) {
      std::sort(seen.begin(), seen.end());
      seen.erase(std::unique(seen.begin(), seen.end()), seen.end());
      model_.keyframe_landmarks.insert(model_.keyframe_landmarks.end(), seen.begin(), seen.end());
      model_.keyframe_landmark_begin.push_back(
          static_cast<std::uint32_t>(model_.keyframe_landmarks.size()));
    }
    SetCamera(largest.cameras[largest.images.front().camera_idx]);
    if (errors_.empty()) return;
    const auto middle = errors_.begin() + static_cast<std::ptrdiff_t>(errors_.size() / 2);
    std::nth_element(errors_.begin(), middle, errors_.end());
    model_.pixel_sigma = std::max(1e-3F, static_cast<float>(*middle / kRayleighMedian));
  }

 private:
  const ImageFeatures& FeaturesOf(const MapImage& image) const {
    return features_.images[idx_of_.at(image.name)];
  }

  // The box that the landmarks fill, cut into 65535 steps along its longest side.
  void AddFrame(const Reconstruction& map, const std::vector<int>& chosen) {
    Eigen::AlignedBox3d box;
    for (const int p : chosen) box.extend(map.points[p].position);
    origin_ = box.center().cast<float>().cast<double>();
    const double half = (box.max() - origin_).cwiseMax(origin_ - box.min()).maxCoeff();
    const auto step = static_cast<float>(std::max(half, 1e-3) * 1.0001 / 32767);
    step_ = double{step};
    model_.map_origin.push_back({static_cast<float>(origin_.x()), static_cast<float>(origin_.y()),
                                 static_cast<float>(origin_.z())});
    model_.map_step.push_back(step);
  }

  void AddLandmark(const Reconstruction& map, const MapPoint& point) {
    const auto landmark = static_cast<std::uint32_t>(model_.landmark_position.size());
    const Eigen::Vector3d steps = (point.position - origin_) / step_;
    std::array<std::int16_t, 3> position;
    for (int axis = 0; axis < 3; ++axis) {
      position[axis] = static_cast<std::int16_t>(std::lround(steps[axis]));
    }
    model_.landmark_position.push_back(position);
    Eigen::VectorXf sum = Eigen::VectorXf::Zero(features_.dim);
    int sign = 0;
    for (const Observation& o : point.track) {
      const MapImage& image = map.images[o.image_idx];
      const ImageFeatures& found = FeaturesOf(image);
      for (int d = 0; d < features_.dim; ++d) {
        sum[d] += found.descriptors[std::size_t(o.feature_idx) * features_.dim + d];
      }
      sign += found.keypoints[o.feature_idx].laplacian_sign;
      AddError(map, image, o, point);
      const auto keyframe = keyframe_of_.find(idx_of_.at(image.name));
      if (keyframe != keyframe_of_.end()) seen_[keyframe->second].push_back(landmark);
    }
    AddChroma(map, point);
    const float scale = kDescriptorLength / std::max(sum.norm(), 1e-6F);
    for (int d = 0; d < features_.dim; ++d) {
      const float value = std::clamp(std::round(sum[d] * scale), -127.0F, 127.0F);
      model_.landmark_descriptors.push_back(static_cast<std::int8_t>(value));
    }
    model_.landmark_laplacian_sign.push_back(static_cast<std::int8_t>(sign > 0   ? 1
                                                                      : sign < 0 ? -1
                                                                                 : 0));
  }

  // Mean of the photographs with colours.
  void AddChroma(const Reconstruction& map, const MapPoint& point) {
    if (features_.options.type != FeatureType::kSurfChroma) return;
    Eigen::Vector<float, kChromaDim> sum = Eigen::Vector<float, kChromaDim>::Zero();
    float seen = 0;
    for (const Observation& o : point.track) {
      const std::vector<std::int8_t>& chroma = FeaturesOf(map.images[o.image_idx]).chroma;
      if (chroma.empty()) continue;
      seen += kLandmarkChromaStep;
      for (int d = 0; d < kChromaDim; ++d) {
        sum[d] += chroma[std::size_t(o.feature_idx) * kChromaDim + d];
      }
    }
    const std::size_t row = model_.landmark_chroma.size();
    for (const float value : sum) {
      model_.landmark_chroma.push_back(
          static_cast<std::int8_t>(std::lround(value / std::max(seen, 1.0F))));
    }
    if (seen == 0) model_.landmark_chroma[row] = kNoLandmarkChroma;
    any_chroma_ = any_chroma_ || seen > 0;
  }

  // Of an observation, in units of its key point's scale.
  void AddError(const Reconstruction& map, const MapImage& image, const Observation& o,
                const MapPoint& point) {
    Eigen::Vector2d pixel;
    if (!map.cameras[image.camera_idx].Project(image.cam_from_world * point.position, pixel))
      return;
    const double scale = double{FeaturesOf(image).keypoints[o.feature_idx].sigma};
    errors_.push_back((pixel - image.keypoints[o.feature_idx]).norm() / scale);
  }

  Eigen::Vector3d Position(std::size_t landmark, std::size_t map) const {
    const auto& steps = model_.landmark_position[landmark];
    const auto& origin = model_.map_origin[map];
    return Eigen::Vector3d(origin[0], origin[1], origin[2]) +
           double{model_.map_step[map]} * Eigen::Vector3d(steps[0], steps[1], steps[2]);
  }

  int SquaredDistance(std::size_t a, std::size_t b) const {
    const std::int8_t* first = &model_.landmark_descriptors[a * features_.dim];
    const std::int8_t* second = &model_.landmark_descriptors[b * features_.dim];
    int sum = 0;
    for (int d = 0; d < features_.dim; ++d) sum += (first[d] - second[d]) * (first[d] - second[d]);
    return sum;
  }

  // Counts for each landmark those that look like it elsewhere: in another map, or farther off
  // than a part of its own. Only landmarks of the nearest visual words are compared.
  void WeighByRarity() {
    const std::size_t size = model_.landmark_position.size();
    const Vocabulary vocabulary(model_.words, features_.dim);
    const int ranks = std::min(kRarityWords, vocabulary.size());
    std::vector<std::uint16_t> words(size * ranks);
    vocabulary.NearestWords(model_.landmark_descriptors, ranks, words);
    std::vector<std::vector<std::size_t>> of_word(vocabulary.size());
    std::vector<std::size_t> map_of(size, 0);
    for (std::size_t l = 0; l < size; ++l) {
      of_word[words[l * ranks]].push_back(l);
      while (model_.map_begin[map_of[l] + 1] <= l) ++map_of[l];
    }
    model_.landmark_rarity.resize(size);
    ParallelFor(static_cast<int>(size), jobs_, [&](int l) {
      const std::size_t map = map_of[l];
      const double reach = kElsewhere * 65535 * double{model_.map_step[map]};
      const Eigen::Vector3d position = Position(l, map);
      int alike = 0;
      for (int r = 0; r < ranks; ++r) {
        for (const std::size_t other : of_word[words[std::size_t(l) * ranks + r]]) {
          const bool near =
              map_of[other] == map && (Position(other, map) - position).norm() < reach;
          if (!near && SquaredDistance(l, other) < kAlike * kAlike) ++alike;
        }
      }
      model_.landmark_rarity[l] = static_cast<std::uint8_t>(255 / (1 + alike));
    });
  }

  void GivePose(const MapImage& image) {
    const auto keyframe = keyframe_of_.find(idx_of_.at(image.name));
    if (keyframe == keyframe_of_.end()) return;
    const Rigid3 world_from_cam = Inverse(image.cam_from_world);
    const auto t = world_from_cam.translation.cast<float>();
    const auto q = world_from_cam.rotation.cast<float>();
    model_.keyframe_has_pose[keyframe->second] = 1;
    model_.keyframe_pose[keyframe->second] = {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()};
  }

  void SetCamera(const Camera& camera) {
    model_.camera.model = static_cast<std::uint8_t>(camera.model);
    model_.camera.width = camera.width;
    model_.camera.height = camera.height;
    model_.camera.intrinsics = {camera.fx, camera.fy, camera.cx, camera.cy};
    model_.camera.distortion = camera.distortion;
  }

  const FeatureStore& features_;
  int jobs_;
  ModelData& model_;
  std::map<std::string, int> idx_of_;             // of an image, by name
  std::map<int, int> keyframe_of_;                // by image
  std::vector<std::vector<std::uint32_t>> seen_;  // [keyframes] landmarks
  std::vector<double> errors_;
  bool any_chroma_ = false;
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  double step_ = 1;
};

}  // namespace

void AddMapToModel(const SiteMap& site, const ImageSet& set, const FeatureStore& features,
                   std::span<const int> keyframe_image_idxs, const ModelMapOptions& options,
                   ModelData& model) {
  if (site.maps.empty()) return;
  std::set<std::string> keyframes;
  for (const int i : keyframe_image_idxs) keyframes.insert(set.images[i].path);
  std::vector<std::vector<int>> chosen;
  std::size_t total = 0;
  for (const Reconstruction& map : site.maps) {
    chosen.push_back(ChoosePoints(map, keyframes, options));
    total += chosen.back().size();
  }
  if (total == 0) return;
  Writer writer(set, features, keyframe_image_idxs, options.jobs, model);
  for (std::size_t m = 0; m < site.maps.size(); ++m) writer.AddMap(site.maps[m], chosen[m]);
  writer.Finish(site.maps.front());
  model.metric = site.metric;
  for (const MapPlacement& placement : site.placements) {
    model.map_metric.push_back(placement.metric ? 1 : 0);
  }
}

}  // namespace viewfix
