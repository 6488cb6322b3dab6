// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/base_map.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/mapping/georeference.h"

namespace viewfix {
namespace {

constexpr double kMaxSteps = 32767;
constexpr int kNone = -1;
constexpr double kFewOutside = 0.02;  // of a map's new landmarks
constexpr std::uint32_t kLeftOut = std::numeric_limits<std::uint32_t>::max();

int MapOf(const ModelData& data, std::uint32_t landmark) {
  const auto after = std::upper_bound(data.map_begin.begin(), data.map_begin.end(), landmark);
  return static_cast<int>(after - data.map_begin.begin()) - 1;
}

std::span<const std::uint32_t> SeenBy(const ModelData& data, int keyframe) {
  if (data.keyframe_landmark_begin.empty()) return {};
  const std::uint32_t begin = data.keyframe_landmark_begin[keyframe];
  return std::span(data.keyframe_landmarks)
      .subspan(begin, data.keyframe_landmark_begin[std::size_t(keyframe) + 1] - begin);
}

// kNone: it sees no landmark.
int MapSeenBy(const ModelData& data, int keyframe) {
  const auto seen = SeenBy(data, keyframe);
  return seen.empty() ? kNone : MapOf(data, seen.front());
}

Eigen::Vector3d CentreOf(const ModelData& data, int keyframe) {
  const auto& row = data.keyframe_pose[keyframe];
  return {double{row[0]}, double{row[1]}, double{row[2]}};
}

Eigen::Vector3d PositionOf(const ModelData& data, std::size_t landmark, int map) {
  const auto& steps = data.landmark_position[landmark];
  const auto& origin = data.map_origin[map];
  return Eigen::Vector3d(double{origin[0]}, double{origin[1]}, double{origin[2]}) +
         double{data.map_step[map]} * Eigen::Vector3d(steps[0], steps[1], steps[2]);
}

// A landmark of the merged model, and where it comes from.
struct Source {
  bool from_base = false;
  std::uint32_t landmark = 0;
};

// Puts the new ones into the holes of those that went, or behind; what is left of the holes goes to
// the last ones, so that nearly all keep their numbers.
std::vector<Source> FillHoles(std::vector<std::optional<Source>> slots,
                              const std::vector<Source>& fresh) {
  std::size_t next = 0;
  for (std::optional<Source>& slot : slots) {
    if (!slot && next < fresh.size()) slot = fresh[next++];
  }
  for (; next < fresh.size(); ++next) slots.emplace_back(fresh[next]);
  std::vector<Source> filled;
  for (std::size_t i = 0; i < slots.size(); ++i) {
    while (!slots.empty() && !slots.back()) slots.pop_back();
    if (i >= slots.size()) break;
    filled.push_back(slots[i] ? *slots[i] : *slots.back());
    if (!slots[i]) slots.pop_back();
  }
  return filled;
}

class MapMerger {
 public:
  MapMerger(const ModelData& base, std::span<const int> base_keyframe, bool poses_given,
            ModelData& model)
      : base_(base), base_keyframe_(base_keyframe), model_(model), fresh_(model) {
    FindTargets(poses_given);
  }

  bool Merge() {
    TakeFrames();
    std::vector<std::vector<Source>> maps = ChooseLandmarks();
    for (int m = 0; m < static_cast<int>(maps.size()); ++m) AddMap(m, maps[m]);
    SetKeyframes();
    if (model_.landmark_position.empty()) ClearMaps();
    return grew_;
  }

 private:
  int NumKeyframes() const { return static_cast<int>(base_keyframe_.size()); }
  int NumBaseMaps() const { return static_cast<int>(base_.map_step.size()); }
  int NumFreshMaps() const { return static_cast<int>(fresh_.map_step.size()); }

  // Which of the base's maps each new one is: that of most photographs that both know.
  void FindTargets(bool poses_given) {
    for (int m = 0; m < NumFreshMaps(); ++m) {
      std::vector<int> votes(NumBaseMaps(), 0);
      for (int k = 0; k < NumKeyframes(); ++k) {
        if (base_keyframe_[k] < 0 || MapSeenBy(fresh_, k) != m) continue;
        const int map = MapSeenBy(base_, base_keyframe_[k]);
        if (map != kNone) ++votes[map];
      }
      const auto best = std::max_element(votes.begin(), votes.end());
      // Given poses are of one frame of reference, whether or not a map holds photographs of both.
      int target = *best > 0 ? static_cast<int>(best - votes.begin()) : kNone;
      if (target == kNone && poses_given) target = 0;
      std::optional<Similarity> base_from_fresh = Similarity();
      if (target != kNone && !poses_given) base_from_fresh = Align(m, target);
      target_.push_back(base_from_fresh ? target : kNone);
      base_from_fresh_.push_back(base_from_fresh.value_or(Similarity()));
    }
  }

  // Nothing: too few photographs are in both.
  std::optional<Similarity> Align(int map, int target) const {
    std::vector<Eigen::Vector3d> here;
    std::vector<Eigen::Vector3d> there;
    for (int k = 0; k < NumKeyframes(); ++k) {
      const int other = base_keyframe_[k];
      if (other < 0 || MapSeenBy(fresh_, k) != map || MapSeenBy(base_, other) != target) continue;
      here.push_back(CentreOf(fresh_, k));
      there.push_back(CentreOf(base_, other));
    }
    return FitSimilarity(here, there);
  }

  void TakeFrames() {
    model_.camera = base_.camera;
    model_.pixel_sigma = base_.pixel_sigma;
    model_.metric = base_.metric;
    model_.map_origin = base_.map_origin;
    model_.map_step = base_.map_step;
    model_.map_metric = base_.map_metric;
    if (model_.map_metric.empty()) model_.map_metric.assign(NumBaseMaps(), base_.metric ? 1 : 0);
    model_.map_begin = {0};
    model_.landmark_position.clear();
    model_.landmark_descriptors.clear();
    model_.landmark_laplacian_sign.clear();
    model_.landmark_rarity.clear();
    model_.landmark_chroma.clear();
  }

  // What photographs that stay, or come, see.
  std::vector<bool> Wanted(const ModelData& data, bool of_base) const {
    std::vector<bool> wanted(data.landmark_position.size(), false);
    for (int k = 0; k < NumKeyframes(); ++k) {
      if ((base_keyframe_[k] >= 0) != of_base) continue;
      for (const std::uint32_t l : SeenBy(data, of_base ? base_keyframe_[k] : k)) wanted[l] = true;
    }
    return wanted;
  }

  // A landmark goes with the last photograph that saw it.
  std::vector<bool> Staying() const {
    std::vector<bool> stays = Wanted(base_, true);
    std::vector<bool> seen(stays.size(), false);
    for (const std::uint32_t l : base_.keyframe_landmarks) seen[l] = true;
    for (std::size_t l = 0; l < stays.size(); ++l) stays[l] = stays[l] || !seen[l];
    return stays;
  }

  // Landmarks of each map of the merged model: the base's maps, then those it does not know.
  std::vector<std::vector<Source>> ChooseLandmarks() {
    const std::vector<bool> stays = Staying();
    const std::vector<bool> comes = Wanted(fresh_, false);
    std::vector<std::vector<std::optional<Source>>> slots(NumBaseMaps());
    for (std::uint32_t l = 0; l < stays.size(); ++l) {
      auto& slot = slots[MapOf(base_, l)].emplace_back();
      if (stays[l]) slot = Source{true, l};
    }
    std::vector<std::vector<Source>> coming(NumFreshMaps());
    for (std::uint32_t l = 0; l < comes.size(); ++l) {
      if (comes[l]) coming[MapOf(fresh_, l)].push_back({false, l});
    }
    std::vector<std::vector<Source>> fresh(NumBaseMaps());
    for (int m = 0; m < NumFreshMaps(); ++m) {
      if (coming[m].empty()) continue;
      if (target_[m] == kNone) {
        target_[m] = static_cast<int>(fresh.size());
        fresh.emplace_back();
        model_.map_origin.push_back(fresh_.map_origin[m]);
        model_.map_step.push_back(fresh_.map_step[m]);
        model_.map_metric.push_back(fresh_.map_metric.empty() ? 0 : fresh_.map_metric[m]);
      }
      if (target_[m] < NumBaseMaps()) DropFewOutside(target_[m], coming[m]);
      auto& to = fresh[target_[m]];
      to.insert(to.end(), coming[m].begin(), coming[m].end());
    }
    slots.resize(fresh.size());
    std::vector<std::vector<Source>> maps;
    for (std::size_t m = 0; m < fresh.size(); ++m) {
      maps.push_back(FillHoles(std::move(slots[m]), fresh[m]));
    }
    return maps;
  }

  // Where few of a map's new landmarks lie beyond the base's frame, they are left out: mostly far
  // and badly known, they would have all positions rounded anew, and a delta hold them all.
  void DropFewOutside(int map, std::vector<Source>& coming) {
    const auto is_outside = [&](const Source& source) {
      return ReachOf(map, Position(source)) > LastStep(map);
    };
    const auto outside = static_cast<double>(std::ranges::count_if(coming, is_outside));
    if (outside > kFewOutside * static_cast<double>(coming.size())) return;
    for (const Source& source : coming) {
      if (is_outside(source)) number_of_fresh_[source.landmark] = kLeftOut;
    }
    std::erase_if(coming, is_outside);
  }

  Eigen::Vector3d Position(const Source& source) const {
    if (source.from_base) return PositionOf(base_, source.landmark, MapOf(base_, source.landmark));
    const int map = MapOf(fresh_, source.landmark);
    return base_from_fresh_[map] * PositionOf(fresh_, source.landmark, map);
  }

  void AddMap(int map, const std::vector<Source>& sources) {
    std::vector<Eigen::Vector3d> positions;
    for (const Source& source : sources) positions.push_back(Position(source));
    const bool grew = GrowFrame(map, positions);
    grew_ = grew_ || grew;
    for (std::size_t i = 0; i < sources.size(); ++i) {
      const Source& source = sources[i];
      const auto landmark = static_cast<std::uint32_t>(model_.landmark_position.size());
      (source.from_base ? number_of_base_ : number_of_fresh_)[source.landmark] = landmark;
      const bool as_it_was = source.from_base && !grew;
      model_.landmark_position.push_back(as_it_was ? base_.landmark_position[source.landmark]
                                                   : Rounded(map, positions[i]));
      Copy(source.from_base ? base_ : fresh_, source.landmark);
    }
    model_.map_begin.push_back(static_cast<std::uint32_t>(model_.landmark_position.size()));
  }

  void Copy(const ModelData& from, std::size_t landmark) {
    const auto add_row = [&](const std::vector<std::int8_t>& rows, int dim,
                             std::vector<std::int8_t>& to) {
      const auto row = rows.begin() + static_cast<std::ptrdiff_t>(landmark * dim);
      to.insert(to.end(), row, row + dim);
    };
    add_row(from.landmark_descriptors, model_.features.descriptor_dim, model_.landmark_descriptors);
    if (!from.landmark_chroma.empty()) {
      add_row(from.landmark_chroma, kLandmarkChromaDim, model_.landmark_chroma);
    } else if (!base_.landmark_chroma.empty() || !fresh_.landmark_chroma.empty()) {
      model_.landmark_chroma.push_back(kNoLandmarkChroma);
      model_.landmark_chroma.resize(model_.landmark_chroma.size() + kLandmarkChromaDim - 1, 0);
    }
    model_.landmark_laplacian_sign.push_back(from.landmark_laplacian_sign[landmark]);
    model_.landmark_rarity.push_back(from.landmark_rarity[landmark]);
  }

  Eigen::Vector3d Origin(int map) const {
    const auto& origin = model_.map_origin[map];
    return {double{origin[0]}, double{origin[1]}, double{origin[2]}};
  }

  double ReachOf(int map, const Eigen::Vector3d& position) const {
    return (position - Origin(map)).cwiseAbs().maxCoeff();
  }

  double LastStep(int map) const { return kMaxSteps * double{model_.map_step[map]}; }

  // The origin stays, the steps become longer, where a position lies beyond the last one.
  bool GrowFrame(int map, const std::vector<Eigen::Vector3d>& positions) {
    double reach = 0;
    for (const Eigen::Vector3d& position : positions) {
      reach = std::max(reach, ReachOf(map, position));
    }
    if (reach <= LastStep(map)) return false;
    model_.map_step[map] = static_cast<float>(reach * 1.0001 / kMaxSteps);
    return true;
  }

  std::array<std::int16_t, 3> Rounded(int map, const Eigen::Vector3d& position) const {
    const Eigen::Vector3d steps = (position - Origin(map)) / double{model_.map_step[map]};
    std::array<std::int16_t, 3> rounded;
    for (int axis = 0; axis < 3; ++axis) {
      rounded[axis] = static_cast<std::int16_t>(std::lround(steps[axis]));
    }
    return rounded;
  }

  void SetKeyframes() {
    model_.keyframe_landmark_begin = {0};
    model_.keyframe_landmarks.clear();
    for (int k = 0; k < NumKeyframes(); ++k) {
      const int other = base_keyframe_[k];
      std::vector<std::uint32_t> seen;
      if (other >= 0) {
        model_.keyframe_has_pose[k] = base_.keyframe_has_pose[other];
        model_.keyframe_pose[k] = base_.keyframe_pose[other];
        for (const std::uint32_t l : SeenBy(base_, other)) seen.push_back(number_of_base_[l]);
      } else {
        MovePose(k);
        for (const std::uint32_t l : SeenBy(fresh_, k)) {
          if (number_of_fresh_[l] != kLeftOut) seen.push_back(number_of_fresh_[l]);
        }
      }
      std::sort(seen.begin(), seen.end());
      model_.keyframe_landmarks.insert(model_.keyframe_landmarks.end(), seen.begin(), seen.end());
      model_.keyframe_landmark_begin.push_back(
          static_cast<std::uint32_t>(model_.keyframe_landmarks.size()));
    }
  }

  void MovePose(int keyframe) {
    const int map = MapSeenBy(fresh_, keyframe);
    if (map == kNone || model_.keyframe_has_pose[keyframe] == 0) return;
    const Similarity& move = base_from_fresh_[map];
    std::array<float, 7>& row = model_.keyframe_pose[keyframe];
    const Eigen::Vector3f t = (move * CentreOf(fresh_, keyframe)).cast<float>();
    const Eigen::Quaternionf q =
        (move.rotation *
         Eigen::Quaterniond(double{row[6]}, double{row[3]}, double{row[4]}, double{row[5]}))
            .normalized()
            .cast<float>();
    row = {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()};
  }

  void ClearMaps() {
    model_.keyframe_landmark_begin.clear();
    model_.map_begin.clear();
    model_.map_origin.clear();
    model_.map_step.clear();
    model_.map_metric.clear();
  }

  const ModelData& base_;
  std::span<const int> base_keyframe_;
  ModelData& model_;
  const ModelData fresh_;                    // the model as it was trained
  std::vector<int> target_;                  // [fresh maps] the base's; kNone: unknown to it
  std::vector<Similarity> base_from_fresh_;  // [fresh maps]
  std::vector<std::uint32_t> number_of_base_ = std::vector<std::uint32_t>(
      base_.landmark_position.size());  // in the merged model, of the base's landmarks
  std::vector<std::uint32_t> number_of_fresh_ =
      std::vector<std::uint32_t>(fresh_.landmark_position.size());
  bool grew_ = false;
};

// The board has one camera, whose rays the kept landmarks were found along.
void CheckCamera(const ModelData::CameraData& base, const ModelData::CameraData& now) {
  const bool same = base.model == now.model && base.width == now.width &&
                    base.height == now.height && base.intrinsics == now.intrinsics &&
                    base.distortion == now.distortion;
  if (!same) throw ToolError("the camera is not the base model's: train without --base");
}

}  // namespace

bool KeepMaps(const ModelData& base, std::span<const int> base_keyframe, bool poses_given,
              ModelData& model) {
  if (poses_given && !model.landmark_position.empty()) CheckCamera(base.camera, model.camera);
  return MapMerger(base, base_keyframe, poses_given, model).Merge();
}

}  // namespace viewfix
