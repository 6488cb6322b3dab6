// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/evaluation/evaluate.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <numeric>

#include "engine/fix_filter.h"
#include "engine/pose/model_geometry.h"
#include "engine/pose/motion_model.h"
#include "engine/scoring/scoring.h"
#include "firmware_tools/dataset/calibration_file.h"
#include "firmware_tools/dataset/image_loader.h"
#include "firmware_tools/evaluation/metrics.h"
#include "firmware_tools/mapping/georeference.h"
#include "firmware_tools/mapping/site_map.h"
#include "firmware_tools/training/model_localizer.h"
#include "platform/clock.h"

namespace viewfix {
namespace {

// The training's record; empty where it is not JSON.
nlohmann::ordered_json RecordOf(const ModelView& model) {
  auto record = nlohmann::ordered_json::parse(model.record(), nullptr, false);
  return record.is_object() ? record : nlohmann::ordered_json::object();
}

std::vector<int> ImagesOf(const ImageSet& set, EvaluateOptions::Split split) {
  using Split = EvaluateOptions::Split;
  std::vector<int> idxs;
  for (int i = 0; i < static_cast<int>(set.images.size()); ++i) {
    const bool test = set.images[i].is_test;
    if (split == Split::kAll || test == (split == Split::kTest)) idxs.push_back(i);
  }
  if (idxs.empty()) {
    throw ToolError(set.source.string() + ": no " + (split == Split::kTest ? "test" : "training") +
                    " images");
  }
  return idxs;
}

int LocationOfKeyframe(const ModelView& model, int keyframe_idx) {
  return model.scoring().pair_location[model.keyframes().pair[keyframe_idx]];
}

int FindLocation(const ModelView& model, const std::string& name) {
  for (int l = 0; l < model.scoring().num_locations; ++l) {
    if (model.location_name(l) == name) return l;
  }
  return -1;
}

// Keyframes, all of them, by similarity to the last frame.
void RankKeyframes(const ModelView& model, std::span<const float> similarity, int truth,
                   FrameResult& result) {
  const int size = model.keyframes().size;
  std::vector<int> order(size);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return similarity[a] > similarity[b]; });
  result.nearest_location = model.location_name(LocationOfKeyframe(model, order[0]));
  for (int rank = 0; rank < size && result.nearest_rank == 0; ++rank) {
    if (LocationOfKeyframe(model, order[rank]) != truth) continue;
    result.nearest_rank = rank + 1;
    result.right_keyframe = model.keyframe_name(order[rank]);
  }
}

struct PoseError {
  double metres;
  double degrees;
};

PoseError ErrorOf(const Similarity& world_from_map, const Rigid3& map_from_cam, const Pose& truth) {
  const Eigen::Vector3d position = world_from_map * map_from_cam.translation;
  const Eigen::Quaterniond rotation = world_from_map.rotation * map_from_cam.rotation;
  return {(position - truth.cam_in_world).norm(),
          rotation.angularDistance(truth.world_from_cam) * 180 / std::numbers::pi};
}

// The map that a keyframe has its pose in; -1: in none.
int MapOfKeyframe(const ModelView& model, int k) {
  const ModelKeyframes& keyframes = model.keyframes();
  const std::uint32_t begin = keyframes.landmark_begin[k];
  const bool mapped = begin < keyframes.landmark_begin[std::size_t(k) + 1];
  return keyframes.has_pose[k] != 0 && mapped ? model.MapOf(keyframes.landmarks[begin]) : -1;
}

// Whether a map's frame of reference is the first map's.
bool SharesFrame(const ModelView& model, int map_idx) {
  return map_idx == 0 || (model.metric() && model.metric(map_idx));
}

// A keyframe in no map has the pose that the set gave it.
bool Comparable(const ModelView& model, int k) {
  const ModelKeyframes& keyframes = model.keyframes();
  if (keyframes.has_pose[k] == 0 || !model.has_landmarks()) return keyframes.has_pose[k] != 0;
  const int map_idx = MapOfKeyframe(model, k);
  return map_idx < 0 ? model.metric() : SharesFrame(model, map_idx);
}

// Where the set's poses say nothing of the map's frame of reference, nothing is compared.
void ComparePoses(const ModelView& model, const std::optional<Similarity>& world_from_map,
                  const ImageRecord& image, FrameResult& result) {
  if (!world_from_map) return;
  const bool has_pose = result.fix.has_pose && SharesFrame(model, result.fix.map_idx);
  // A metric map is drawn as it is, over its floor plan; another one as it lies among the poses.
  const Similarity drawn_from_world = model.metric() ? Inverse(*world_from_map) : Similarity();
  if (has_pose) {
    const Eigen::Vector3d& in_map = result.fix.world_from_cam.translation;
    result.position = model.metric() ? in_map : *world_from_map * in_map;
  }
  if (!image.pose) return;
  result.true_position = drawn_from_world * image.pose->cam_in_world;
  const int k = result.fix.keyframe_idx;
  if (k >= 0 && Comparable(model, k)) {
    const PoseError error =
        ErrorOf(*world_from_map, KeyframePose(model.keyframes(), k), *image.pose);
    result.keyframe_distance = error.metres;
    result.keyframe_angle_deg = error.degrees;
  }
  if (has_pose) {
    const PoseError error = ErrorOf(*world_from_map, result.fix.world_from_cam, *image.pose);
    result.translation_error = error.metres;
    result.rotation_error_deg = error.degrees;
  }
}

// Lays the largest map over the training images' poses, if the map has a scale of its own; if
// control points moved it away from the set's poses, moves it back. Nothing: fewer than three of
// its keyframes have a pose in the set, or all on a line.
std::optional<Similarity> AlignMap(const ImageSet& set, const ModelView& model,
                                   const nlohmann::ordered_json& record,
                                   std::optional<Evaluation::Alignment>& alignment) {
  if (model.metric() || !model.has_landmarks()) {
    return Inverse(SiteFromSet(record.value("map", nlohmann::ordered_json())));
  }
  std::map<std::string, const ImageRecord*> training;
  for (const ImageRecord& image : set.images) {
    if (image.pose && !image.is_test) training[image.path] = &image;
  }
  std::vector<Eigen::Vector3d> in_map;
  std::vector<Eigen::Vector3d> in_world;
  for (int k = 0; k < model.keyframes().size; ++k) {
    const auto image = training.find(std::string(model.keyframe_name(k)));
    if (image == training.end() || MapOfKeyframe(model, k) != 0) continue;
    in_map.push_back(KeyframePose(model.keyframes(), k).translation);
    in_world.push_back(image->second->pose->cam_in_world);
  }
  const std::optional<Similarity> world_from_map = FitSimilarity(in_map, in_world);
  if (!world_from_map) return std::nullopt;
  std::vector<double> errors;
  double sum2 = 0;
  for (std::size_t i = 0; i < in_map.size(); ++i) {
    errors.push_back((*world_from_map * in_map[i] - in_world[i]).norm());
    sum2 += errors.back() * errors.back();
  }
  const auto count = static_cast<double>(errors.size());
  alignment = {static_cast<int>(errors.size()), std::sqrt(sum2 / count), *Quantile(errors, 0.5)};
  return world_from_map;
}

std::string BestByScoreAlone(const ModelView& model, std::span<const float> pair_scores) {
  std::vector<float> scores(model.scoring().num_locations);
  ScoreLocations(model.scoring(), pair_scores, scores);
  const auto best = std::max_element(scores.begin(), scores.end()) - scores.begin();
  return std::string(model.location_name(static_cast<int>(best)));
}

void Describe(const ModelView& model, const Localizer& localizer, const ImageRecord& image,
              FrameResult& result) {
  if (result.fix.location_idx < 0) return;
  result.location = model.location_name(result.fix.location_idx);
  result.view = model.view_name(model.scoring().pair_view[result.fix.pair_idx]);
  if (result.fix.keyframe_idx >= 0) result.keyframe = model.keyframe_name(result.fix.keyframe_idx);
  if (result.fix.tracked) return;  // without scores
  const int truth = FindLocation(model, image.location);
  if (truth >= 0) {
    const auto scores = localizer.location_scores();
    result.location_rank =
        1 + static_cast<int>(std::count_if(scores.begin(), scores.end(),
                                           [&](float s) { return s > scores[truth]; }));
  }
  result.scored_location = BestByScoreAlone(model, localizer.pair_scores());
  RankKeyframes(model, localizer.keyframe_similarities(), truth, result);
}

// Reads and localizes the images of a split one by one.
class Evaluator {
 public:
  Evaluator(const ImageSet& set, const ModelView& model,
            const std::optional<Similarity>& world_from_map, const EvaluateOptions& options)
      : set_(set),
        model_(model),
        world_from_map_(world_from_map),
        sequence_(options.sequence),
        localizer_(MakeModelLocalizer(model, {.now_ns = &MonotonicNs, .window = options.window})) {
    if (options.filter) filter_.emplace(model);
  }

  // Throws ToolError where the image cannot be read.
  FrameResult Run(int image_idx) {
    const ImageRecord& image = set_.images[image_idx];
    BeginFrame(image_idx);
    FrameResult result;
    result.image_idx = image_idx;
    const YuvImage pixels = LoadImage(set_.FullPath(image));
    result.fix = Localize(image, pixels);
    Describe(model_, localizer_, image, result);
    ComparePoses(model_, world_from_map_, image, result);
    return result;
  }

 private:
  // Frames count by their place in the set: images of another split between two frames are time
  // that passed. Between captures so much passes that nothing is known any more.
  void BeginFrame(int image_idx) {
    const std::string& capture = set_.images[image_idx].capture;
    if (capture != capture_) captures_before_ += 1;
    capture_ = capture;
    sequence_number_ =
        static_cast<std::uint64_t>(image_idx) + captures_before_ * 2 * MotionModel::kMaxGap;
  }

  Fix Localize(const ImageRecord& image, const YuvImage& pixels) {
    Prior prior;
    prior.sequence = sequence_number_;
    Camera camera;
    if (image.camera_idx >= 0) {
      camera = ToCamera(set_.cameras[image.camera_idx]);
      prior.camera = &camera;
    }
    const auto prediction = sequence_ ? motion_.Predict(sequence_number_) : std::nullopt;
    if (prediction) {
      prior.cam_from_world = &prediction->cam_from_world;
      prior.map_idx = prediction->map_idx;
    }
    Result<Fix> fix = localizer_.Localize(pixels.view(), prior);
    if (!fix.ok()) throw ToolError(set_.FullPath(image).string() + ": " + fix.status().text());
    if (fix->has_pose) {
      motion_.Update(sequence_number_, fix->map_idx, fix->world_from_cam);
    } else {
      motion_.Lose();
    }
    if (filter_) filter_->Apply(sequence_number_, *fix);
    return *fix;
  }

  const ImageSet& set_;
  const ModelView& model_;
  std::optional<Similarity> world_from_map_;
  bool sequence_;
  Localizer localizer_;
  MotionModel motion_;
  std::optional<FixFilter> filter_;
  std::string capture_;
  std::uint64_t captures_before_ = 0;
  std::uint64_t sequence_number_ = 0;
};

void RefuseMostlyUnreadable(const ImageSet& set, const Evaluation& evaluation, std::size_t asked) {
  if (evaluation.skipped.size() * 5 <= asked) return;
  throw ToolError(set.source.string() + ": " + std::to_string(evaluation.skipped.size()) + " of " +
                  std::to_string(asked) +
                  " images could not be read, the first: " + evaluation.skipped.front());
}

}  // namespace

Evaluation Evaluate(const ImageSet& set, const ModelView& model, const EvaluateOptions& options,
                    const Progress& progress) {
  Evaluation evaluation;
  evaluation.model_bytes = model.bytes().size();
  evaluation.positions_in = model.metric() ? Evaluation::Frame::kSite : Evaluation::Frame::kSet;
  const nlohmann::ordered_json record = RecordOf(model);
  evaluation.model_has_view_labels = record.value("view_source", "") == "labels";
  const std::vector<int> idxs = ImagesOf(set, options.split);
  const std::optional<Similarity> world_from_map =
      AlignMap(set, model, record, evaluation.alignment);
  Evaluator evaluator(set, model, world_from_map, options);
  for (int n = 0; n < static_cast<int>(idxs.size()); ++n) {
    try {
      evaluation.frames.push_back(evaluator.Run(idxs[n]));
    } catch (const ToolError& error) {
      evaluation.skipped.push_back(error.what());
    }
    if (progress) progress(n + 1, static_cast<int>(idxs.size()));
  }
  RefuseMostlyUnreadable(set, evaluation, idxs.size());
  return evaluation;
}

}  // namespace viewfix
