// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/pose_confidence.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <memory>
#include <numbers>
#include <optional>

#include "firmware_tools/dataset/calibration_file.h"
#include "firmware_tools/dataset/image_loader.h"
#include "firmware_tools/training/confidence.h"
#include "firmware_tools/training/model_localizer.h"

namespace viewfix {
namespace {

constexpr double kMaxMetres = 0.5;
constexpr double kMaxShareOfDepth = 0.1;  // where units are no metres
constexpr double kMaxTurn = 10 * std::numbers::pi / 180;
// The locations are hidden in so many parts.
constexpr int kLocationParts = 2;

using Weights = Eigen::Matrix<double, kPoseCues + 1, 1>;  // the offset, then the cues'
using Hessian = Eigen::Matrix<double, kPoseCues + 1, kPoseCues + 1>;
// What the weights are drawn towards, and how much: a site whose held-out frames are all right has
// shown nothing of poses of views that nobody photographed, most of which are wrong. Mean of the
// curves of five museums and of HoloLens' training photographs.
constexpr std::array<double, kPoseCues + 1> kUsualWeights = {-3.5, 1.25, 4, 2.5};
constexpr double kRidge = 0.75;
constexpr int kIterations = 50;

struct KeyframePlace {
  Rigid3 world_from_cam;
  int map_idx = -1;
  double depth = 0;  // median distance of its landmarks, world units
};

double DepthOf(const ModelData& model, std::size_t keyframe, int map_idx,
               const Eigen::Vector3d& cam_in_world) {
  std::vector<double> distances;
  for (std::uint32_t i = model.keyframe_landmark_begin[keyframe];
       i < model.keyframe_landmark_begin[keyframe + 1]; ++i) {
    const auto& steps = model.landmark_position[model.keyframe_landmarks[i]];
    Eigen::Vector3d point;
    for (int axis = 0; axis < 3; ++axis) {
      point[axis] = double{model.map_origin[map_idx][axis]} +
                    double{model.map_step[map_idx]} * double(steps[axis]);
    }
    distances.push_back((point - cam_in_world).norm());
  }
  const auto middle = distances.begin() + std::ssize(distances) / 2;
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

// Poses of the keyframes that are in a map, by name.
std::map<std::string, KeyframePlace> PlacesOf(const ModelData& model) {
  std::map<std::string, KeyframePlace> places;
  for (std::size_t k = 0; k < model.keyframe_names.size(); ++k) {
    const std::uint32_t begin = model.keyframe_landmark_begin[k];
    if (begin == model.keyframe_landmark_begin[k + 1]) continue;
    const std::uint32_t landmark = model.keyframe_landmarks[begin];
    const auto map = std::upper_bound(model.map_begin.begin(), model.map_begin.end(), landmark);
    const auto& p = model.keyframe_pose[k];
    const int map_idx = static_cast<int>(map - model.map_begin.begin()) - 1;
    const Eigen::Vector3d cam_in_world = Eigen::Vector3f(p[0], p[1], p[2]).cast<double>();
    places[model.keyframe_names[k]] = {
        {Eigen::Quaternionf(p[6], p[3], p[4], p[5]).cast<double>(), cam_in_world},
        map_idx,
        DepthOf(model, k, map_idx, cam_in_world)};
  }
  return places;
}

class Trial {
 public:
  Trial(const PoseConfidenceSource& source, const PoseConfidenceOptions& options)
      : source_(source), options_(options), places_(PlacesOf(source.model)) {
    std::map<int, int> seen;
    for (const int pair : source.pairs) turn_.push_back(seen[pair]++ % options.hold_out);
  }

  // Of the frames held out for themselves (part < 0), or with their locations.
  std::vector<PoseOutcome> Run(int part, const Progress& progress) {
    std::vector<bool> hidden(source_.image_idxs.size());
    std::vector<int> asked;
    for (int s = 0; s < static_cast<int>(hidden.size()); ++s) {
      hidden[s] = part < 0 ? turn_[s] == 0 : source_.locations[s] % kLocationParts == part;
      if (hidden[s] && turn_[s] == 0) asked.push_back(s);
    }
    if (asked.empty() || asked.size() == hidden.size()) return {};
    PartialModel partial = source_.without(hidden);
    if (partial.model.landmark_position.empty()) return {};
    partial.model.pose_confidence = ModelPoseConfidence();  // whose threshold every pose reaches
    const auto bytes = WriteModel(partial.model);
    if (!bytes.ok()) throw ToolError(std::string("held-out model: ") + bytes.status().text());
    return Ask(*bytes, partial.map_idx, asked, part >= 0, progress);
  }

 private:
  std::vector<PoseOutcome> Ask(const std::vector<std::uint8_t>& bytes,
                               const std::vector<int>& map_idx, const std::vector<int>& asked,
                               bool of_hidden, const Progress& progress) const {
    const auto model = ModelView::Open(bytes);
    if (!model.ok()) throw ToolError(std::string("held-out model: ") + model.status().text());
    std::vector<std::unique_ptr<Localizer>> localizers(Workers(options_.jobs));
    for (auto& localizer : localizers) {
      localizer = std::make_unique<Localizer>(MakeModelLocalizer(*model, {}));
    }
    std::vector<std::optional<PoseOutcome>> outcomes(asked.size());
    ParallelForWorkers(
        static_cast<int>(asked.size()), options_.jobs,
        [&](int i, int worker) {
          outcomes[i] =
              OutcomeOf(Localize(*localizers[worker], asked[i]), map_idx, of_hidden, asked[i]);
        },
        progress);
    std::vector<PoseOutcome> given;
    for (const auto& outcome : outcomes) {
      if (outcome) given.push_back(*outcome);
    }
    return given;
  }

  Fix Localize(Localizer& localizer, int sample) const {
    const ImageRecord& image = source_.set.images[source_.image_idxs[sample]];
    Prior prior;
    Camera camera;
    if (image.camera_idx >= 0) {
      camera = ToCamera(source_.set.cameras[image.camera_idx]);
      prior.camera = &camera;
    }
    const YuvImage pixels = LoadImage(source_.set.FullPath(image));
    const Result<Fix> fix = localizer.Localize(pixels.view(), prior);
    return fix.ok() ? *fix : Fix();
  }

  std::optional<PoseOutcome> OutcomeOf(const Fix& fix, const std::vector<int>& map_idx,
                                       bool of_hidden, int sample) const {
    if (!fix.has_pose) return std::nullopt;
    return PoseOutcome{
        PoseCuesOf(fix.num_inliers, fix.evidence, fix.expected_evidence, fix.evidence_spread),
        IsRight(fix, map_idx[fix.map_idx], sample), of_hidden};
  }

  bool IsRight(const Fix& fix, int map_idx, int sample) const {
    const auto truth = places_.find(source_.set.images[source_.image_idxs[sample]].path);
    if (truth == places_.end()) return fix.location_idx == source_.locations[sample];
    const Rigid3& pose = truth->second.world_from_cam;
    const double reach = source_.model.map_metric[map_idx] != 0
                             ? kMaxMetres
                             : kMaxShareOfDepth * truth->second.depth;
    return truth->second.map_idx == map_idx &&
           (pose.translation - fix.world_from_cam.translation).norm() <= reach &&
           pose.rotation.angularDistance(fix.world_from_cam.rotation) <= kMaxTurn;
  }

  const PoseConfidenceSource& source_;
  const PoseConfidenceOptions& options_;
  std::map<std::string, KeyframePlace> places_;
  std::vector<int> turn_;  // [samples] 0: held out
};

Weights RowOf(const PoseCues& cues) {
  Weights row;
  row[0] = 1;
  for (int c = 0; c < kPoseCues; ++c) row[c + 1] = double{cues[c]};
  return row;
}

double WeightOf(const PoseOutcome& outcome, double hidden_weight) {
  return outcome.of_hidden_place ? hidden_weight : 1;
}

// Newton's method on the smoothed likelihood and the usual weights; those that are not used stay
// zero.
Weights Fit(std::span<const PoseOutcome> outcomes, double hidden_weight,
            const std::array<bool, kPoseCues>& used) {
  double right = 0, wrong = 0;
  for (const PoseOutcome& o : outcomes) (o.right ? right : wrong) += WeightOf(o, hidden_weight);
  const double target_right = (right + 1) / (right + 2), target_wrong = 1 / (wrong + 2);
  const Weights usual = Eigen::Map<const Weights>(kUsualWeights.data());
  Weights weights = usual;
  for (int c = 0; c < kPoseCues; ++c) {
    if (!used[c]) weights[c + 1] = 0;
  }
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Weights gradient = kRidge * (weights - usual);
    Hessian hessian = kRidge * Hessian::Identity();
    for (const PoseOutcome& o : outcomes) {
      const Weights row = RowOf(o.cues);
      const double weight = WeightOf(o, hidden_weight);
      const double p = 1 / (1 + std::exp(-weights.dot(row)));
      gradient += weight * (p - (o.right ? target_right : target_wrong)) * row;
      hessian += weight * std::max(1e-6, p * (1 - p)) * row * row.transpose();
    }
    for (int c = 0; c < kPoseCues; ++c) {
      if (used[c]) continue;
      gradient[c + 1] = 0;
      hessian.row(c + 1).setZero();
      hessian.col(c + 1).setZero();
      hessian(c + 1, c + 1) = 1;
    }
    const Weights step = hessian.ldlt().solve(gradient);
    weights -= step * std::min(1.0, 5 / std::max(1e-12, step.norm()));
    if (step.norm() < 1e-9) break;
  }
  return weights;
}

}  // namespace

std::vector<PoseOutcome> HoldOutPoses(const PoseConfidenceSource& source,
                                      const PoseConfidenceOptions& options,
                                      const Progress& progress) {
  Trial trial(source, options);
  std::vector<PoseOutcome> outcomes;
  for (int part = -1; part < kLocationParts; ++part) {
    const auto of_part = trial.Run(part, [&](int done, int total) {
      if (progress) progress((part + 1) * total + done, (kLocationParts + 1) * total);
    });
    outcomes.insert(outcomes.end(), of_part.begin(), of_part.end());
  }
  return outcomes;
}

ModelPoseConfidence FitPoseConfidence(std::span<const PoseOutcome> outcomes,
                                      const PoseConfidenceOptions& options) {
  std::array<bool, kPoseCues> used;
  used.fill(true);
  Weights weights = Fit(outcomes, options.hidden_weight, used);
  while (weights.tail<kPoseCues>().minCoeff() < 0) {
    for (int c = 0; c < kPoseCues; ++c) used[c] = used[c] && weights[c + 1] >= 0;
    weights = Fit(outcomes, options.hidden_weight, used);
  }
  weights = weights.cast<float>().cast<double>().eval();  // as the model keeps them
  ModelPoseConfidence curve;
  curve.offset = static_cast<float>(weights[0]);
  for (int c = 0; c < kPoseCues; ++c) curve.weights[c] = static_cast<float>(weights[c + 1]);
  std::vector<Outcome> of_known;
  for (const PoseOutcome& o : outcomes) {
    if (!o.of_hidden_place) of_known.push_back({weights.dot(RowOf(o.cues)), o.right});
  }
  ModelConfidence limit = {0, 1, 0.5F};
  LimitWrongAnswers(of_known, options.wrong_share, limit, options.chance);
  curve.threshold = limit.threshold;
  return curve;
}

}  // namespace viewfix
