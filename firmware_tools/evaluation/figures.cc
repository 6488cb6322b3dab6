// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "engine/base/location_name.h"
#include "firmware_tools/evaluation/evaluate.h"
#include "firmware_tools/evaluation/metrics.h"

namespace viewfix {
namespace {

using Json = nlohmann::ordered_json;
using Frames = std::vector<FrameResult>;

// A pose this far off, or farther, is a wrong answer.
constexpr double kWrongMetres = 0.5;
constexpr double kWrongDegrees = 10;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

Json Share(int hits, int of) { return of == 0 ? Json() : Json(static_cast<double>(hits) / of); }

Json Ci95(int hits, int of) {
  const Interval interval = WilsonInterval(hits, of);
  return of == 0 ? Json() : Json({interval.low, interval.high});
}

Json OrNull(const std::optional<double>& value) {
  return value && std::isfinite(*value) ? Json(*value) : Json();
}

Json Position(const std::optional<Eigen::Vector3d>& position) {
  return position ? Json({position->x(), position->y(), position->z()}) : Json();
}

Json NameOrNull(const std::string& name) { return name.empty() ? Json() : Json(name); }

Json Reasons(const Fix& fix) {
  Json names = Json::array();
  for (const Reason reason : kAllReasons) {
    if ((fix.reasons & reason) != 0) names.push_back(ReasonName(reason));
  }
  return names;
}

class Figures {
 public:
  Figures(const ImageSet& set, const Evaluation& evaluation) : set_(set), evaluation_(evaluation) {}

  Json Location() const {
    return Accuracy([](const FrameResult& f) { return f.location; });
  }
  Json ScoreAlone() const {
    return Accuracy([](const FrameResult& f) { return f.scored_location; });
  }
  Json NearestKeyframe() const {
    return Accuracy([](const FrameResult& f) { return f.nearest_location; });
  }
  Json View() const;
  Json Retrieval() const;
  Json Pose() const;
  Json Refusal() const;
  Json Confidence() const;
  Json Latency() const;
  Json PerLocation() const;
  Json Confusion() const;
  Json Failures() const;
  Json PositionsIn() const {
    return evaluation_.positions_in == Evaluation::Frame::kSite ? "site" : "set";
  }
  Json PerFrame() const;

 private:
  const ImageRecord& Truth(const FrameResult& f) const { return set_.images[f.image_idx]; }
  bool HasLocation(const FrameResult& f) const { return !Truth(f).location.empty(); }
  bool HasView(const FrameResult& f) const {
    return evaluation_.model_has_view_labels && !Truth(f).view.empty();
  }
  // As far as answered: of "floor10/lobby", the floor may be all that is said.
  bool LocationRight(const FrameResult& f) const {
    if (f.fix.level == 0) return f.location == Truth(f).location;
    return UpToLevel(f.location, f.fix.level) == UpToLevel(Truth(f).location, f.fix.level);
  }
  int AnsweredLevels(const FrameResult& f) const {
    if (!f.fix.localized) return 0;
    return f.fix.level == 0 ? LevelsOf(f.location) : f.fix.level;
  }
  bool Wrong(const FrameResult& f) const {
    return (HasLocation(f) && !LocationRight(f)) ||
           (HasView(f) && f.fix.level == 0 && f.view != Truth(f).view) ||
           (f.translation_error &&
            (*f.translation_error > kWrongMetres || *f.rotation_error_deg > kWrongDegrees));
  }
  int Count(const std::function<bool(const FrameResult&)>& predicate) const {
    return static_cast<int>(
        std::count_if(evaluation_.frames.begin(), evaluation_.frames.end(), predicate));
  }
  int size() const { return static_cast<int>(evaluation_.frames.size()); }
  int MaxLevels() const;
  Json Accuracy(const std::function<std::string(const FrameResult&)>& guess) const;
  Json RecallAt(const std::function<int(const FrameResult&)>& rank) const;
  Json Times(float StageTimes::*stage) const;

  const ImageSet& set_;
  const Evaluation& evaluation_;
};

int Figures::MaxLevels() const {
  int levels = 0;
  for (const FrameResult& f : evaluation_.frames) {
    if (HasLocation(f)) levels = std::max(levels, LevelsOf(Truth(f).location));
  }
  return levels;
}

// Best guesses, answered or not. A frame without a guess is wrong.
Json Figures::Accuracy(const std::function<std::string(const FrameResult&)>& guess) const {
  const int labelled = Count([&](const FrameResult& f) { return HasLocation(f); });
  Json by_level = Json::array();
  for (int level = 1; level <= MaxLevels(); ++level) {
    by_level.push_back(Share(Count([&](const FrameResult& f) {
                               return HasLocation(f) && UpToLevel(guess(f), level) ==
                                                            UpToLevel(Truth(f).location, level);
                             }),
                             labelled));
  }
  const int right =
      Count([&](const FrameResult& f) { return HasLocation(f) && guess(f) == Truth(f).location; });
  return {{"accuracy", Share(right, labelled)},
          {"ci95", Ci95(right, labelled)},
          {"by_level", by_level},
          {"labelled", labelled}};
}

Json Figures::View() const {
  const int labelled = Count([&](const FrameResult& f) { return HasView(f); });
  const int right =
      Count([&](const FrameResult& f) { return HasView(f) && f.view == Truth(f).view; });
  return {{"accuracy", Share(right, labelled)},
          {"ci95", Ci95(right, labelled)},
          {"labelled", labelled}};
}

Json Figures::RecallAt(const std::function<int(const FrameResult&)>& rank) const {
  const int labelled = Count([&](const FrameResult& f) { return HasLocation(f); });
  Json recall = Json::object();
  for (const int n : {1, 5, 20, 50}) {
    const int found =
        Count([&](const FrameResult& f) { return HasLocation(f) && rank(f) > 0 && rank(f) <= n; });
    recall[std::to_string(n)] = Share(found, labelled);
  }
  return recall;
}

Json Figures::Retrieval() const {
  const int with_pose = Count([&](const FrameResult& f) { return Truth(f).pose.has_value(); });
  const int near = Count([](const FrameResult& f) {
    return f.keyframe_distance && *f.keyframe_distance <= 1 && *f.keyframe_angle_deg <= 30;
  });
  return {{"recall_at", RecallAt([](const FrameResult& f) { return f.location_rank; })},
          {"keyframe_recall_at", RecallAt([](const FrameResult& f) { return f.nearest_rank; })},
          {"within_1m_30deg", Share(near, with_pose)},
          {"poses", with_pose}};
}

// A frame without a pose counts as infinitely far.
Json Figures::Pose() const {
  struct Threshold {
    const char* name;
    double metres, degrees;
  };
  constexpr Threshold kThresholds[] = {{"0.05m_2deg", 0.05, 2}, {"0.05m_5deg", 0.05, 5},
                                       {"0.1m_5deg", 0.1, 5},   {"0.25m_2deg", 0.25, 2},
                                       {"0.5m_5deg", 0.5, 5},   {"5m_10deg", 5, 10}};
  const int labelled = Count([&](const FrameResult& f) { return Truth(f).pose.has_value(); });
  std::vector<double> metres;
  std::vector<double> degrees;
  int localized = 0;
  for (const FrameResult& f : evaluation_.frames) {
    if (!Truth(f).pose) continue;
    const bool answered = f.fix.localized && f.translation_error.has_value();
    localized += answered ? 1 : 0;
    metres.push_back(answered ? *f.translation_error : kInfinity);
    degrees.push_back(answered ? *f.rotation_error_deg : kInfinity);
  }
  Json recall = Json::object();
  for (const Threshold& at : kThresholds) {
    int within = 0;
    for (std::size_t i = 0; i < metres.size(); ++i) {
      within += metres[i] <= at.metres && degrees[i] <= at.degrees ? 1 : 0;
    }
    recall[at.name] = Share(within, labelled);
  }
  Json pose = {{"labelled", labelled},
               {"localized", Share(localized, labelled)},
               {"median_translation_m", OrNull(Quantile(metres, 0.5))},
               {"median_rotation_deg", OrNull(Quantile(degrees, 0.5))},
               {"p90_translation_m", OrNull(Quantile(metres, 0.9))},
               {"recall", recall}};
  if (evaluation_.alignment) {
    pose["alignment"] = {{"training_images", evaluation_.alignment->images},
                         {"rmse_m", evaluation_.alignment->rmse},
                         {"median_m", evaluation_.alignment->median}};
  }
  return pose;
}

Json Figures::Refusal() const {
  const int answered = Count([](const FrameResult& f) { return f.fix.localized; });
  const int wrong = Count([&](const FrameResult& f) { return f.fix.localized && Wrong(f); });
  Json by_level = Json::array();
  for (int level = 1; level <= MaxLevels(); ++level) {
    // A name of fewer parts than others have is whole at every level.
    const int this_far = Count([&](const FrameResult& f) {
      return f.fix.localized && (f.fix.level == 0 || AnsweredLevels(f) >= level);
    });
    by_level.push_back(Share(this_far, size()));
  }
  return {{"answered", Share(answered, size())},
          {"answered_by_level", by_level},
          {"wrong_of_answered", Share(wrong, answered)},
          {"wrong_ci95", Ci95(wrong, answered)}};
}

Json ReliabilityPoints(std::span<const Judgement> judgements) {
  Json points = Json::array();
  for (const ReliabilityBin& bin : ReliabilityDiagram({judgements.begin(), judgements.end()})) {
    points.push_back({{"confidence", bin.confidence},
                      {"right", bin.right},
                      {"right_ci95", Ci95(bin.hits, bin.count)},
                      {"images", bin.count}});
  }
  return points;
}

Json RiskCoveragePoints(std::span<const Judgement> judgements) {
  Json points = Json::array();
  for (const RiskCoverage& at : RiskCoverageCurve({judgements.begin(), judgements.end()})) {
    points.push_back({{"coverage", at.coverage}, {"risk", at.risk}, {"confidence", at.confidence}});
  }
  return points;
}

Json Figures::Confidence() const {
  std::vector<Judgement> judgements;
  for (const FrameResult& f : evaluation_.frames) {
    if (HasLocation(f)) judgements.push_back({double{f.fix.confidence}, LocationRight(f)});
  }
  if (judgements.empty()) {
    return {{"ece", nullptr},
            {"ece_ci95", nullptr},
            {"brier", nullptr},
            {"brier_constant", nullptr},
            {"auroc", nullptr},
            {"risk_at_80_coverage", nullptr},
            {"reliability", Json::array()},
            {"risk_coverage", Json::array()}};
  }
  const Interval ece = BootstrapCalibrationError(judgements);
  return {{"ece", ExpectedCalibrationError(judgements)},
          {"ece_ci95", {ece.low, ece.high}},
          {"brier", BrierScore(judgements)},
          {"brier_constant", ConstantBrierScore(judgements)},
          {"auroc", OrNull(AreaUnderRoc(judgements))},
          {"risk_at_80_coverage", RiskAtCoverage(judgements, 0.8)},
          {"reliability", ReliabilityPoints(judgements)},
          {"risk_coverage", RiskCoveragePoints(judgements)}};
}

Json Figures::Times(float StageTimes::*stage) const {
  std::vector<double> times;
  for (const FrameResult& f : evaluation_.frames) times.push_back(double{f.fix.ms.*stage});
  return {{"p50", OrNull(Quantile(times, 0.5))},
          {"p95", OrNull(Quantile(times, 0.95))},
          {"p99", OrNull(Quantile(times, 0.99))}};
}

Json Figures::Latency() const {
  Json latency = Times(&StageTimes::total);
  latency["stages"] = {{"features", Times(&StageTimes::features)},
                       {"score", Times(&StageTimes::score)},
                       {"verify", Times(&StageTimes::verify)},
                       {"pose", Times(&StageTimes::pose)}};
  return latency;
}

// In the order of the names.
Json Figures::PerLocation() const {
  struct Tally {
    int images = 0, right = 0, answered = 0, wrong = 0;
  };
  std::map<std::string, Tally> tallies;
  for (const FrameResult& f : evaluation_.frames) {
    if (!HasLocation(f)) continue;
    Tally& tally = tallies[Truth(f).location];
    tally.images += 1;
    tally.right += f.location == Truth(f).location ? 1 : 0;
    tally.answered += f.fix.localized ? 1 : 0;
    tally.wrong += f.fix.localized && Wrong(f) ? 1 : 0;
  }
  Json rows = Json::array();
  for (const auto& [name, tally] : tallies) {
    rows.push_back({{"location", name},
                    {"images", tally.images},
                    {"right", tally.right},
                    {"answered", tally.answered},
                    {"wrong", tally.wrong}});
  }
  return rows;
}

// The pairs of true location and best guess that occur; a guess of null: none.
Json Figures::Confusion() const {
  std::map<std::pair<std::string, std::string>, int> counts;
  for (const FrameResult& f : evaluation_.frames) {
    if (HasLocation(f)) counts[{Truth(f).location, f.location}] += 1;
  }
  Json cells = Json::array();
  for (const auto& [pair, images] : counts) {
    cells.push_back({{"true", pair.first}, {"guess", NameOrNull(pair.second)}, {"images", images}});
  }
  return cells;
}

// Frames whose answer or best guess is wrong, as places in `frames`: answers first, the surest of
// each first.
Json Figures::Failures() const {
  std::vector<int> failures;
  for (int i = 0; i < size(); ++i) {
    if (Wrong(evaluation_.frames[i])) failures.push_back(i);
  }
  std::stable_sort(failures.begin(), failures.end(), [&](int a, int b) {
    const Fix& fix_a = evaluation_.frames[a].fix;
    const Fix& fix_b = evaluation_.frames[b].fix;
    return fix_a.localized != fix_b.localized ? fix_a.localized
                                              : fix_a.confidence > fix_b.confidence;
  });
  return failures;
}

Json Figures::PerFrame() const {
  Json rows = Json::array();
  for (const FrameResult& f : evaluation_.frames) {
    rows.push_back({{"path", Truth(f).path},
                    {"localized", f.fix.localized},
                    {"level", AnsweredLevels(f)},
                    {"wrong", Wrong(f)},
                    {"reasons", Reasons(f.fix)},
                    {"location", f.location},
                    {"true_location", Truth(f).location},
                    {"location_rank", f.location_rank},
                    {"scored_location", f.scored_location},
                    {"nearest_location", f.nearest_location},
                    {"view", f.view},
                    {"true_view", Truth(f).view},
                    {"confidence", f.fix.confidence},
                    {"score", f.fix.score},
                    {"margin", f.fix.margin},
                    {"features", f.fix.num_features},
                    {"keyframe", NameOrNull(f.keyframe)},
                    {"right_keyframe", NameOrNull(f.right_keyframe)},
                    {"position", Position(f.position)},
                    {"true_position", Position(f.true_position)},
                    {"keyframe_distance_m", OrNull(f.keyframe_distance)},
                    {"keyframe_angle_deg", OrNull(f.keyframe_angle_deg)},
                    {"inliers", f.fix.num_inliers},
                    {"evidence", f.fix.evidence},
                    {"expected_evidence", f.fix.expected_evidence},
                    {"evidence_spread", f.fix.evidence_spread},
                    {"rival_evidence", f.fix.rival_evidence},
                    {"tracked", f.fix.tracked},
                    {"translation_error_m", OrNull(f.translation_error)},
                    {"rotation_error_deg", OrNull(f.rotation_error_deg)}});
  }
  return rows;
}

// What was said where nothing should have been.
Json UnknownFrames(const Evaluation& unknown) {
  Json rows = Json::array();
  for (const FrameResult& f : unknown.frames) {
    rows.push_back({{"localized", f.fix.localized},
                    {"location", f.location},
                    {"confidence", f.fix.confidence},
                    {"margin", f.fix.margin},
                    {"inliers", f.fix.num_inliers},
                    {"evidence", f.fix.evidence},
                    {"expected_evidence", f.fix.expected_evidence},
                    {"evidence_spread", f.fix.evidence_spread}});
  }
  return rows;
}

void AddFrames(const Figures& figures, Json& json) {
  json["latency_ms"] = figures.Latency();
  json["locations"] = figures.PerLocation();
  json["confusion"] = figures.Confusion();
  json["failures"] = figures.Failures();
  json["positions_in"] = figures.PositionsIn();
  json["frames"] = figures.PerFrame();
}

}  // namespace

Json SectionsAsJson(const ModelView& model) {
  const ModelSections sections = model.sections();
  return {{"vocabulary", sections.vocabulary},
          {"weights", sections.weights},
          {"keyframe_histograms", sections.keyframe_histograms},
          {"keyframe_poses", sections.keyframe_poses},
          {"keyframe_landmarks", sections.keyframe_landmarks},
          {"keyframe_names", sections.keyframe_names},
          {"landmark_positions", sections.landmark_positions},
          {"landmark_descriptors", sections.landmark_descriptors},
          {"landmark_chroma", sections.landmark_chroma},
          {"details", sections.details},
          {"golden_queries", sections.golden_queries},
          {"floor_plan", sections.floor_plan},
          {"record", sections.record}};
}

Json FiguresAsJson(const ImageSet& set, const Evaluation& evaluation, const Evaluation* unknown) {
  const Figures figures(set, evaluation);
  Json json;
  json["schema"] = 1;
  json["sequence"] = false;
  json["images"] = evaluation.frames.size();
  json["skipped"] = evaluation.skipped.size();
  json["model_bytes"] = evaluation.model_bytes;
  json["location"] = figures.Location();
  json["view"] = figures.View();
  json["score_alone"] = figures.ScoreAlone();
  json["nearest_keyframe"] = figures.NearestKeyframe();
  json["retrieval"] = figures.Retrieval();
  json["pose"] = figures.Pose();
  json["refusal"] = figures.Refusal();
  json["confidence"] = figures.Confidence();
  json["unknown"] = nullptr;
  if (unknown != nullptr) {
    const auto localized = std::count_if(unknown->frames.begin(), unknown->frames.end(),
                                         [](const FrameResult& f) { return f.fix.localized; });
    json["unknown"] = {
        {"images", unknown->frames.size()},
        {"localized", Share(static_cast<int>(localized), static_cast<int>(unknown->frames.size()))},
        {"frames", UnknownFrames(*unknown)}};
  }
  AddFrames(figures, json);
  return json;
}

Json SequenceAsJson(const ImageSet& set, const Evaluation& sequence, const Json& alone) {
  const Figures figures(set, sequence);
  const auto tracked = std::count_if(sequence.frames.begin(), sequence.frames.end(),
                                     [](const FrameResult& f) { return f.fix.tracked; });
  Json json = alone;
  json["sequence"] = true;
  json["tracked"] = Share(static_cast<int>(tracked), static_cast<int>(sequence.frames.size()));
  json["location"] = figures.Location();
  json["view"] = figures.View();
  json["pose"] = figures.Pose();
  json["refusal"] = figures.Refusal();
  json["confidence"] = figures.Confidence();
  AddFrames(figures, json);
  json["frame_alone"] = alone;
  return json;
}

}  // namespace viewfix
