// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/trainer.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <span>

#include "engine/localizer.h"
#include "firmware_tools/mapping/map_points.h"
#include "firmware_tools/training/confidence.h"
#include "firmware_tools/training/golden_queries.h"
#include "firmware_tools/training/histograms.h"
#include "firmware_tools/training/kmeans.h"
#include "firmware_tools/training/pose_confidence.h"

namespace viewfix {
namespace {

using Json = nlohmann::ordered_json;

// Where a map has no metres to make cells by.
constexpr int kImagesPerCell = 12;

Progress Begin(const StageProgress& stages, const std::string& stage) {
  return stages ? stages(stage) : Progress();
}

std::vector<int> TrainingImages(const ImageSet& set) {
  std::vector<int> idxs;
  for (int i = 0; i < static_cast<int>(set.images.size()); ++i) {
    if (!set.images[i].is_test) idxs.push_back(i);
  }
  if (idxs.empty()) throw ToolError(set.source.string() + ": no training images");
  return idxs;
}

// Tells of every failure, and refuses a set that is mostly broken.
void ReportFailures(const ImageSet& set, const FeatureStore& features, std::size_t asked,
                    std::vector<std::string>& warnings) {
  for (const FeatureStore::Failure& failure : features.failures) {
    warnings.push_back("skipped " + failure.cause);
  }
  if (features.failures.empty()) return;
  const std::string count = std::to_string(features.failures.size()) + " of " +
                            std::to_string(asked) + " training images";
  if (features.failures.size() * 5 > asked) {
    throw ToolError(set.source.string() + ": " + count +
                    " could not be used, the first: " + features.failures.front().cause);
  }
  warnings.push_back(count + " could not be used");
}

// Locations whose every image failed.
void CheckEmptyLocations(const ImageSet& set, std::span<const int> asked,
                         const FeatureStore& features) {
  std::map<std::string, bool> alive;
  for (const int i : asked) {
    if (HasPlace(set, set.images[i])) {
      alive[set.images[i].location] |= !features.images[i].keypoints.empty();
    }
  }
  for (const auto& [location, has_images] : alive) {
    if (!has_images) {
      throw ToolError(set.source.string() + ": location '" + location +
                      "' has no usable training image");
    }
  }
}

int WordsPerFeature(const TrainOptions& options) {
  return std::min(options.words_per_feature, options.num_words);
}

std::vector<std::int8_t> AllDescriptors(const FeatureStore& features) {
  std::vector<std::int8_t> all;
  for (const ImageFeatures& image : features.images) {
    all.insert(all.end(), image.descriptors.begin(), image.descriptors.end());
  }
  return all;
}

Hash256 KeyOf(std::span<const std::int8_t> descriptors, int dim, const KMeansOptions& options) {
  constexpr int kKeptVersion = 1;  // rises whenever the same descriptors would give other words
  ContentHash key;
  key.AddText("vocabulary");
  key.Add(kKeptVersion);
  key.Add(options.num_words);
  key.Add(options.max_iterations);
  key.Add(options.seed);
  key.Add(dim);
  key.AddAll(descriptors);
  return key.Result();
}

// Of a vocabulary in a file.
struct WordsCodec {
  std::size_t bytes;

  void Save(const std::vector<std::int8_t>& words, ByteWriter& writer) const {
    writer.AddAll(std::span<const std::int8_t>(words));
  }
  bool Load(ByteReader& reader, std::vector<std::int8_t>& words) const {
    words.resize(bytes);
    reader.TakeAll(std::span<std::int8_t>(words));
    return true;
  }
};

std::vector<std::int8_t> WordsOf(const FeatureStore& features, const TrainOptions& options,
                                 const StageProgress& stages) {
  if (options.base) {
    const ModelFeatures& frozen = options.base->data.features;
    if (frozen.version == features.version && frozen.descriptor_dim == features.dim) {
      return options.base->data.words;
    }
    throw ToolError("the base model's features are another version's: train without --base");
  }
  const KMeansOptions clustering = {
      .num_words = options.num_words, .seed = options.seed, .jobs = options.jobs};
  const std::vector<std::int8_t> descriptors = AllDescriptors(features);
  const auto compute = [&] {
    return ClusterDescriptors(descriptors, features.dim, clustering, Begin(stages, "vocabulary"))
        .words;
  };
  if (!options.cache) return compute();
  return options.cache->Recall("vocabulary", KeyOf(descriptors, features.dim, clustering),
                               WordsCodec{std::size_t(clustering.num_words) * features.dim},
                               compute);
}

void CheckEnough(const ImageSet& set, const Labels& labels) {
  if (labels.locations.size() < 2) {
    throw ToolError(set.source.string() + ": only one location ('" + labels.locations[0] +
                    "'): at least two are needed to tell apart");
  }
  if (labels.num_pairs() > 65535) {
    throw ToolError(set.source.string() + ": more than 65535 (location, view) pairs");
  }
  for (int l = 0; l < static_cast<int>(labels.locations.size()); ++l) {
    const auto images = std::count(labels.location.begin(), labels.location.end(), l);
    if (images == 1 && labels.location_source == "labels") {
      throw ToolError(set.source.string() + ": location '" + labels.locations[l] +
                      "' has one training image: at least two are needed");
    }
  }
}

ScoreOptions FirstGuess(const TrainOptions& options) {
  ScoreOptions guess;
  if (options.c) guess.c = *options.c;
  if (options.beta) guess.beta = *options.beta;
  if (options.other_views_negative) guess.other_views_negative = *options.other_views_negative;
  return guess;
}

// Candidates along one parameter, the best so far excluded: it has been measured.
std::vector<ScoreOptions> Along(const ScoreOptions& best, std::span<const double> values,
                                double ScoreOptions::*parameter) {
  std::vector<ScoreOptions> candidates;
  for (const double value : values) {
    if (value == best.*parameter) continue;
    candidates.push_back(best);
    candidates.back().*parameter = value;
  }
  return candidates;
}

Json ToJson(const HeldOut& result) {
  return {{"c", result.options.c},
          {"beta", result.options.beta},
          {"other_views_negative", result.options.other_views_negative},
          {"keyframe_weight", result.options.keyframe_weight},
          {"location_rule",
           result.options.rule == LocationRule::kBestPair ? "best_pair" : "sum_of_pairs"},
          {"held_out", result.predictions.size()},
          {"location_accuracy", result.location_accuracy},
          {"view_accuracy", result.view_accuracy}};
}

// Held-out recall of each location and view, in the order of pairs: what a user may expect of it.
Json RecallByPair(const Labels& labels, const HeldOut& result) {
  std::vector<int> asked(labels.num_pairs(), 0);
  std::vector<int> right(labels.num_pairs(), 0);
  for (const HeldOut::Prediction& p : result.predictions) {
    const int truth = labels.pair[p.sample];
    ++asked[truth];
    right[truth] += p.location == labels.pair_location[truth] ? 1 : 0;
  }
  return {{"held_out", asked}, {"right", right}};
}

Json Record(const ImageSet& set, const TrainOptions& options, const Preparation& prepared,
            const std::vector<HeldOut>& tried) {
  const Labels& labels = prepared.labels;
  Json record;
  record["images"] = set.images.size();
  record["samples"] = labels.image_idxs.size();
  record["skipped"] = prepared.features.failures.size();
  record["locations"] = labels.locations.size();
  record["pairs"] = labels.num_pairs();
  record["location_source"] = labels.location_source;
  record["view_source"] = labels.view_source;
  record["words"] = options.num_words;
  record["seed"] = options.seed;
  record["folds"] = options.folds;
  record["wrong_shares"] = {{"scores", options.wrong_share},
                            {"details", options.details.wrong_share},
                            {"poses", options.pose_confidence.wrong_share}};
  record["chosen"] = ToJson(tried.front());
  record["tried"] = Json::array();
  for (const HeldOut& result : tried) record["tried"].push_back(ToJson(result));
  record["recall"] = RecallByPair(labels, tried.front());
  record["map"] = MapsAsJson(prepared.site);
  return record;
}

// Four bits with one scale a column: the largest weight becomes 7.
void QuantizeWeights(const ScoreModel& scores, ModelData& model) {
  const Eigen::Index words = scores.weights.rows();
  const Eigen::Index pairs = scores.weights.cols();
  model.weights.resize(words * pairs);
  for (Eigen::Index p = 0; p < pairs; ++p) {
    const float largest = std::max(scores.weights.col(p).cwiseAbs().maxCoeff(), 1e-20F);
    const float scale = largest / static_cast<float>(kWeightBias - 1);
    model.weight_scale.push_back(scale);
    for (Eigen::Index w = 0; w < words; ++w) {
      model.weights[w * pairs + p] =
          static_cast<std::int8_t>(std::lround(scores.weights(w, p) / scale));
    }
  }
  model.bias = scores.bias;
}

std::array<float, 7> PoseRow(const std::optional<Pose>& pose) {
  if (!pose) return {};
  const auto t = pose->cam_in_world.cast<float>();
  const auto q = pose->world_from_cam.cast<float>();
  return {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()};
}

std::optional<Pose> Moved(const std::optional<Pose>& pose, const Similarity& site_from_set) {
  if (!pose) return pose;
  return Pose{(site_from_set.rotation * pose->world_from_cam).normalized(),
              site_from_set * pose->cam_in_world};
}

// Returns the image of each keyframe.
//   hidden  [samples] those that make none
std::vector<int> AddKeyframes(const ImageSet& set, const TrainOptions& options,
                              const Preparation& prepared, const std::vector<bool>& hidden,
                              ModelData& model) {
  const Labels& labels = prepared.labels;
  std::vector<int> order;
  for (int s = 0; s < static_cast<int>(labels.pair.size()); ++s) {
    if (!hidden[s]) order.push_back(s);
  }
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return labels.pair[a] < labels.pair[b]; });
  std::vector<int> image_idxs;
  for (const int s : order) {
    const Histogram& h = prepared.keyframe_histograms[s];
    image_idxs.push_back(labels.image_idxs[s]);
    const std::optional<Pose> pose =
        options.map.source == MapSource::kPoses
            ? Moved(set.images[labels.image_idxs[s]].pose, prepared.site.site_from_set)
            : std::nullopt;
    model.keyframe_pair.push_back(static_cast<std::uint16_t>(labels.pair[s]));
    model.keyframe_words.insert(model.keyframe_words.end(), h.words.begin(), h.words.end());
    for (const std::uint8_t count : h.counts) {
      model.keyframe_counts.push_back(std::min<std::uint8_t>(count, kMaxKeyframeCount));
    }
    model.keyframe_word_begin.push_back(static_cast<std::uint32_t>(model.keyframe_words.size()));
    model.keyframe_has_pose.push_back(pose ? 1 : 0);
    model.keyframe_pose.push_back(PoseRow(pose));
    model.keyframe_names.push_back(set.images[labels.image_idxs[s]].path);
    model.metric = model.metric || pose.has_value();
  }
  return image_idxs;
}

ModelFeatures FeaturesOf(const FeatureStore& store) {
  const FeatureOptions& o = store.options;
  return {static_cast<std::uint8_t>(o.type),
          store.version,
          o.max_image_side,
          o.max_features,
          o.upright,
          o.threshold,
          store.dim};
}

std::vector<Outcome> OutcomesOf(const Labels& labels, const HeldOut& result) {
  std::vector<Outcome> outcomes;
  for (const HeldOut::Prediction& p : result.predictions) {
    outcomes.push_back({p.margin, p.location == labels.location[p.sample]});
  }
  return outcomes;
}

Json DetailsAsJson(const TrainedDetails& details, const ModelConfidence& confidence) {
  const auto right = std::ranges::count_if(details.held_out, &Outcome::right);
  return {{"details", details.table.codes.size() / details.table.parts},
          {"likeness_weight", details.table.likeness_weight},
          {"close_weight", details.table.close_weight},
          {"held_out", details.held_out.size()},
          {"right", right},
          {"answered", AnsweredOf(details.held_out, confidence).share},
          {"elsewhere_answered", AnsweredOf(details.elsewhere, confidence).share}};
}

// What they tell decides, so that the confidence is a curve of their lead. Returns how
// they fared.
TrainedDetails AddDetails(const Preparation& prepared, const TrainOptions& options,
                          const StageProgress& stages, ModelData& model) {
  if (!model.landmark_position.empty() || options.details.max_bytes == 0) return {};
  const Labels& labels = prepared.labels;
  DetailSource source = {prepared.features,    labels.image_idxs,
                         labels.location,      static_cast<int>(labels.locations.size()),
                         prepared.words,       WordsPerFeature(options),
                         prepared.similarities};
  if (options.base) {
    source.rotation = options.base->data.details.rotation;
    source.codebook = options.base->data.details.codebook;
  }
  TrainedDetails details = TrainDetails(source, options.details, Begin(stages, "details"));
  if (details.table.codes.empty() || details.held_out.empty()) return {};
  model.details = details.table;
  model.confidence = FitDetailConfidence(details, options.details);
  return details;
}

// Keyframes and landmarks of the samples that are not hidden.
PartialModel WithPartOfMap(const ImageSet& set, const TrainOptions& options,
                           const Preparation& prepared, const std::vector<bool>& hidden,
                           const ModelData& without_map) {
  PartialModel partial{without_map, {}};
  const std::vector<int> keyframes = AddKeyframes(set, options, prepared, hidden, partial.model);
  std::set<std::string> names;
  for (std::size_t s = 0; s < hidden.size(); ++s) {
    if (hidden[s]) names.insert(set.images[prepared.labels.image_idxs[s]].path);
  }
  SiteMap site;
  site.metric = prepared.site.metric;
  for (std::size_t m = 0; m < prepared.site.maps.size(); ++m) {
    Reconstruction map = Without(prepared.site.maps[m], names);
    if (map.points.empty()) continue;
    site.maps.push_back(std::move(map));
    site.placements.push_back(prepared.site.placements[m]);
    partial.map_idx.push_back(static_cast<int>(m));
  }
  if (site.maps.empty()) return partial;
  AddMapToModel(site, set, prepared.MapFeatures(), keyframes, options.model_map, partial.model);
  return partial;
}

// How poses of held-out frames fared.
std::vector<PoseOutcome> AddPoseConfidence(const ImageSet& set, const Preparation& prepared,
                                           const TrainOptions& options,
                                           const ModelData& without_map,
                                           const StageProgress& stages, ModelData& model) {
  if (model.landmark_position.empty()) return {};
  if (options.base && options.base->data.pose_confidence) {
    model.pose_confidence = options.base->data.pose_confidence;  // one place does not change it
    return {};
  }
  const Labels& labels = prepared.labels;
  const PoseConfidenceSource source = {set,
                                       labels.image_idxs,
                                       labels.location,
                                       labels.pair,
                                       model,
                                       [&](const std::vector<bool>& hidden) {
                                         return WithPartOfMap(set, options, prepared, hidden,
                                                              without_map);
                                       }};
  PoseConfidenceOptions confidence = options.pose_confidence;
  confidence.jobs = options.jobs;
  auto outcomes = HoldOutPoses(source, confidence, Begin(stages, "held-out poses"));
  if (!outcomes.empty()) model.pose_confidence = FitPoseConfidence(outcomes, confidence);
  return outcomes;
}

Json PosesAsJson(const std::vector<PoseOutcome>& outcomes) {
  const auto right =
      std::count_if(outcomes.begin(), outcomes.end(), [](const PoseOutcome& o) { return o.right; });
  return {{"held_out", outcomes.size()}, {"right", right}};
}

Json BaseAsJson(const BaseModel& base, const BaseReport& report) {
  return {{"model", base.id},
          {"kept", report.kept.size()},
          {"trained", report.trained},
          {"removed", report.removed}};
}

// The base's sections wherever nothing changed, and its plan unless another one is given.
BaseReport TakeBase(const TrainOptions& options, ModelData& model) {
  if (!options.base) return {};
  model.floor_plan = options.base->data.floor_plan;
  return KeepUnchanged(*options.base, options.map.source == MapSource::kPoses, model);
}

template <typename T>
void AssignAll(const std::vector<int>& from, std::vector<T>& to) {
  for (const int value : from) to.push_back(static_cast<T>(value));
}

template <typename T>
std::vector<T> Kept(const std::vector<T>& all, const std::vector<int>& kept) {
  std::vector<T> part;
  for (const int i : kept) part.push_back(all[i]);
  return part;
}

std::optional<FeatureStore> ExtractMapFeatures(const ImageSet& set, const TrainOptions& options,
                                               std::span<const int> image_idxs,
                                               const StageProgress& stages) {
  const bool from_photographs = options.map.source == MapSource::kColmap;
  if (!from_photographs || options.map_features <= options.features.max_features) {
    return std::nullopt;
  }
  FeatureOptions more = options.features;
  more.max_features = options.map_features;
  return ExtractFeatures(set, image_idxs, more, options.jobs, Begin(stages, "features of the map"),
                         options.cache.get());
}

// Whether a photograph helps, though nobody said where it was taken: a map needs no names.
bool IsForTheMap(const ImageRecord& image, MapSource source) {
  return source == MapSource::kColmap ||
         (source == MapSource::kPoses && image.pose && image.camera_idx >= 0);
}

// Labels of the samples; those that have no place served the map alone and are dropped.
void LabelSamples(const ImageSet& set, const LabelOptions& options, const std::vector<int>& samples,
                  Preparation& prepared) {
  std::vector<int> kept;
  for (int s = 0; s < static_cast<int>(samples.size()); ++s) {
    if (HasPlace(set, set.images[samples[s]])) kept.push_back(s);
  }
  prepared.histograms = Kept(prepared.histograms, kept);
  prepared.keyframe_histograms = Kept(prepared.keyframe_histograms, kept);
  prepared.gram = prepared.gram(kept, kept).eval();
  prepared.similarities = prepared.similarities(kept, kept).eval();
  prepared.labels = MakeLabels(set, Kept(samples, kept), prepared.gram, options);
}

// Locations and views where poses come from the map. Units may be the map's own, so that cells are
// made by the number of images in them.
void LabelByMap(const ImageSet& set, const TrainOptions& options, const std::vector<int>& samples,
                Preparation& prepared) {
  const ImageSet mapped = WithMappedPoses(set, prepared.site);
  LabelOptions labels = options.labels;
  if (!prepared.site.metric) labels.cell_size = CellSizeOf(mapped, kImagesPerCell);
  LabelSamples(mapped, labels, samples, prepared);
}

}  // namespace

// Where a record has a number of that name.
void TakeNumber(const Json& record, const char* name, double& number) {
  if (!record.is_object()) return;
  if (const auto it = record.find(name); it != record.end() && it->is_number()) number = *it;
}

void TakeFrozenOptions(std::shared_ptr<const BaseModel> base, TrainOptions& options) {
  const ModelData& frozen = base->data;
  options.features = FeatureOptionsOf(frozen.features);
  options.num_words =
      static_cast<int>(frozen.words.size()) / std::max(1, frozen.features.descriptor_dim);
  options.words_per_feature = frozen.words_per_feature;
  options.histogram_map = frozen.histogram_map;
  if (!frozen.details.codes.empty()) options.details.parts = frozen.details.parts;
  const Json record = Json::parse(frozen.record, nullptr, false);
  const Json chosen = record.is_object() ? record.value("chosen", Json::object()) : Json::object();
  if (chosen.is_object()) {
    if (const auto c = chosen.find("c"); c != chosen.end() && c->is_number()) options.c = *c;
    if (const auto b = chosen.find("beta"); b != chosen.end() && b->is_number()) options.beta = *b;
    const auto negatives = chosen.find("other_views_negative");
    if (negatives != chosen.end() && negatives->is_boolean()) {
      options.other_views_negative = negatives->get<bool>();
    }
  }
  const Json shares = record.is_object() ? record.value("wrong_shares", Json()) : Json();
  TakeNumber(shares, "scores", options.wrong_share);
  TakeNumber(shares, "details", options.details.wrong_share);
  TakeNumber(shares, "poses", options.pose_confidence.wrong_share);
  options.base = std::move(base);
}

FeatureStore ExtractTrainingFeatures(const ImageSet& set, const TrainOptions& options,
                                     const StageProgress& stages) {
  return ExtractFeatures(set, TrainingImages(set), options.features, options.jobs,
                         Begin(stages, "features"), options.cache.get());
}

Preparation PrepareFeatures(const ImageSet& set, FeatureStore features, const TrainOptions& options,
                            const StageProgress& stages) {
  Preparation prepared;
  prepared.features = std::move(features);
  const int dim = prepared.features.dim;
  prepared.words = WordsOf(prepared.features, options, stages);
  const bool map_first = options.map.source == MapSource::kColmap;
  std::vector<int> samples;
  for (int i = 0; i < static_cast<int>(set.images.size()); ++i) {
    const bool usable = !prepared.features.images[i].keypoints.empty();
    const ImageRecord& image = set.images[i];
    const bool wanted = HasPlace(set, image) || IsForTheMap(image, options.map.source);
    if (usable && wanted) samples.push_back(i);
  }
  const Vocabulary vocabulary(prepared.words, dim);
  for (ImageHistograms& h :
       BuildHistograms(prepared.features, samples, vocabulary, WordsPerFeature(options),
                       options.histogram_map, options.jobs, Begin(stages, "histograms"))) {
    prepared.histograms.push_back(std::move(h.frame));
    prepared.keyframe_histograms.push_back(std::move(h.keyframe));
  }
  prepared.gram = GramMatrix(prepared.histograms, vocabulary.size(), options.jobs);
  prepared.similarities = KeyframeSimilarities(prepared.histograms, prepared.keyframe_histograms,
                                               vocabulary.size(), options.jobs);
  prepared.map_features = ExtractMapFeatures(set, options, samples, stages);
  prepared.site = MapSite(set, prepared.MapFeatures(), samples, prepared.gram, options.map, stages);
  if (map_first) {
    LabelByMap(set, options, samples, prepared);
  } else {
    LabelSamples(set, options.labels, samples, prepared);
  }
  return prepared;
}

Preparation Prepare(const ImageSet& set, const TrainOptions& options, const StageProgress& stages) {
  const std::vector<int> asked = TrainingImages(set);
  FeatureStore features = ExtractTrainingFeatures(set, options, stages);
  std::vector<std::string> warnings;
  ReportFailures(set, features, asked.size(), warnings);
  CheckEmptyLocations(set, asked, features);
  Preparation prepared = PrepareFeatures(set, std::move(features), options, stages);
  CheckEnough(set, prepared.labels);
  for (const std::string& warning : prepared.site.warnings) warnings.push_back(warning);
  prepared.warnings = std::move(warnings);
  return prepared;
}

std::vector<HeldOut> ChooseScoreOptions(const Preparation& prepared, const TrainOptions& options,
                                        const StageProgress& stages) {
  const Labels& labels = prepared.labels;
  const std::vector<int> fold = HeldOutBlocks(labels, options.folds);
  const auto measure = [&](const std::string& stage, std::span<const ScoreOptions> candidates) {
    return CrossValidate(labels, prepared.gram, prepared.similarities, fold, options.folds,
                         candidates, options.jobs, Begin(stages, stage));
  };
  const ScoreOptions start = FirstGuess(options);
  std::vector<HeldOut> tried = measure("held-out blocks", std::span(&start, 1));
  std::size_t best = 0;
  const auto try_all = [&](const std::string& stage, const std::vector<ScoreOptions>& candidates) {
    for (HeldOut& result : measure(stage, candidates)) {
      tried.push_back(std::move(result));
      if (Merit(labels, tried.back()) > Merit(labels, tried[best])) best = tried.size() - 1;
    }
  };
  constexpr double kCosts[] = {1, 3, 10, 30, 100};
  constexpr double kBetas[] = {0.03, 0.1, 0.3, 1, 3, 10};
  if (!options.c) try_all("choosing C", Along(tried[best].options, kCosts, &ScoreOptions::c));
  if (!options.other_views_negative) {
    ScoreOptions other = tried[best].options;
    other.other_views_negative = !other.other_views_negative;
    try_all("choosing negatives", {other});
  }
  if (!options.beta) {
    try_all("choosing beta", Along(tried[best].options, kBetas, &ScoreOptions::beta));
  }
  std::swap(tried[0], tried[best]);
  return tried;
}

TrainResult Train(const ImageSet& set, const Preparation& prepared, const TrainOptions& options,
                  const StageProgress& stages) {
  const std::vector<HeldOut> tried = ChooseScoreOptions(prepared, options, stages);
  const ScoreOptions& chosen = tried.front().options;
  const Labels& labels = prepared.labels;
  const ScoreModel scores =
      TrainScores(labels, prepared.gram, prepared.histograms,
                  static_cast<int>(prepared.words.size()) / prepared.features.dim, chosen,
                  options.jobs, Begin(stages, "scores"));

  TrainResult result;
  result.chosen = tried.front();
  ModelData& model = result.model;
  model.features = FeaturesOf(prepared.features);
  model.words = prepared.words;
  model.words_per_feature = WordsPerFeature(options);
  model.histogram_map = options.histogram_map;
  model.location_rule = chosen.rule;
  model.keyframe_weight = static_cast<float>(chosen.keyframe_weight);
  model.locations = labels.locations;
  model.views = labels.views;
  AssignAll(labels.pair_location, model.pair_location);
  AssignAll(labels.pair_view, model.pair_view);
  QuantizeWeights(scores, model);
  const std::vector<Outcome> held_out = OutcomesOf(labels, tried.front());
  model.confidence = FitConfidence(held_out);
  LimitWrongAnswers(held_out, options.wrong_share, model.confidence);
  const ModelData without_map = model;
  const std::vector<bool> none(labels.image_idxs.size(), false);
  const std::vector<int> keyframes = AddKeyframes(set, options, prepared, none, model);
  AddMapToModel(prepared.site, set, prepared.MapFeatures(), keyframes, options.model_map, model);
  const std::vector<PoseOutcome> poses =
      AddPoseConfidence(set, prepared, options, without_map, stages, model);
  const TrainedDetails details = AddDetails(prepared, options, stages, model);
  result.details_held_out = details.held_out;
  result.details_elsewhere = details.elsewhere;
  result.base = TakeBase(options, model);
  if (options.floor_plan) {
    const FloorPlan& plan = *options.floor_plan;
    model.floor_plan = {plan.picture, plan.width, plan.height, plan.site_from_pixel};
  }
  Json record = Record(set, options, prepared, tried);
  if (!details.held_out.empty()) record["details"] = DetailsAsJson(details, model.confidence);
  if (!poses.empty()) record["held_out_poses"] = PosesAsJson(poses);
  if (options.base) record["base"] = BaseAsJson(*options.base, result.base);
  model.record = record.dump();
  AddGoldenQueries(prepared.features, options.base ? &options.base->data : nullptr, model);
  return result;
}

}  // namespace viewfix
