// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/experiment/experiment.h"

#include <algorithm>
#include <map>
#include <set>

#include "firmware_tools/experiment/libsvm.h"
#include "firmware_tools/experiment/linear_predictor.h"
#include "firmware_tools/experiment/multitask_methods.h"
#include "firmware_tools/experiment/nearest_neighbour.h"
#include "firmware_tools/experiment/prediction_time.h"
#include "firmware_tools/experiment/svm_methods.h"
#include "firmware_tools/training/feature_store.h"
#include "firmware_tools/training/histograms.h"
#include "firmware_tools/training/kmeans.h"

namespace viewfix {
namespace {

// Views of a single-view SVM each, at most: more are no named directions.
constexpr int kMaxSingleViews = 8;
// Steps of a split's progress bar that each method takes.
constexpr int kTicks = 1000;

// The images that take part, named: where views mean the same everywhere, every image has its
// location and view by name, so that each split's labels agree.
struct Samples {
  ImageSet set;
  std::vector<int> image_idxs;
  std::vector<int> group_of;  // what splits are drawn of
  bool views_named = false;
  std::string location_source;
  std::string view_source;
};

Progress Begin(const StageProgress& stages, const std::string& stage) {
  return stages ? stages(stage) : Progress();
}

int IndexOf(const std::vector<std::string>& names, const std::string& name) {
  const auto found = std::find(names.begin(), names.end(), name);
  return found == names.end() ? -1 : static_cast<int>(found - names.begin());
}

std::vector<int> ImagesWithPlace(const ImageSet& set) {
  std::vector<int> idxs;
  for (int i = 0; i < static_cast<int>(set.images.size()); ++i) {
    if (HasPlace(set, set.images[i])) idxs.push_back(i);
  }
  return idxs;
}

// The locations with the most training images; the first by name among equals.
std::set<std::string> LargestLocations(const ImageSet& set, const std::vector<int>& idxs, int max) {
  std::map<std::string, int> count;
  for (const int i : idxs) count[set.images[i].location] += set.images[i].is_test ? 0 : 1;
  std::vector<std::pair<int, std::string>> order;
  for (const auto& [name, n] : count) order.emplace_back(-n, name);
  std::sort(order.begin(), order.end());
  std::set<std::string> kept;
  for (std::size_t i = 0; i < order.size() && (max == 0 || i < static_cast<std::size_t>(max));
       ++i) {
    kept.insert(order[i].second);
  }
  return kept;
}

void NameImages(const Labels& labels, const ExperimentOptions& options, Samples& samples) {
  samples.views_named = labels.global_views;
  samples.location_source = labels.location_source;
  samples.view_source = labels.view_source;
  for (std::size_t s = 0; s < labels.image_idxs.size(); ++s) {
    ImageRecord& image = samples.set.images[labels.image_idxs[s]];
    image.location = labels.locations[labels.location[s]];
    image.view = labels.global_views ? labels.views[labels.pair_view[labels.pair[s]]] : "";
  }
  const auto kept = LargestLocations(samples.set, labels.image_idxs, options.max_locations);
  for (std::size_t s = 0; s < labels.image_idxs.size(); ++s) {
    const int i = labels.image_idxs[s];
    if (kept.count(samples.set.images[i].location) == 0) continue;
    samples.image_idxs.push_back(i);
    samples.group_of.push_back(labels.global_views ? labels.pair[s] : labels.location[s]);
  }
}

// Views made from the order of images are made of each split's training images alone; that order
// tells nothing of a test image, so that test images have no view then.
Samples ChooseSamples(const ImageSet& set, const ExperimentOptions& options) {
  Samples samples;
  samples.set = set;
  const std::vector<int> idxs = ImagesWithPlace(set);
  const auto n = static_cast<Eigen::Index>(idxs.size());
  NameImages(MakeLabels(set, idxs, Eigen::MatrixXf::Zero(n, n), options.labels), options, samples);
  return samples;
}

std::vector<std::string> Names(const Samples& samples, std::string ImageRecord::*name) {
  std::set<std::string> names;
  for (const int i : samples.image_idxs) names.insert(samples.set.images[i].*name);
  names.erase("");
  return {names.begin(), names.end()};
}

// Drops the images that features could not be found in.
FeatureStore FindFeatures(Samples& samples, const ExperimentOptions& options,
                          const StageProgress& stages, ExperimentResult& result) {
  FeatureStore features = ExtractFeatures(samples.set, samples.image_idxs, options.features,
                                          options.jobs, Begin(stages, "features"));
  for (const auto& failure : features.failures) {
    result.warnings.push_back("skipped " + failure.cause);
  }
  if (features.failures.size() * 5 > samples.image_idxs.size()) {
    throw ToolError(samples.set.source.string() + ": " + std::to_string(features.failures.size()) +
                    " of " + std::to_string(samples.image_idxs.size()) +
                    " images could not be used, the first: " + features.failures.front().cause);
  }
  std::vector<int> kept;
  std::vector<int> groups;
  for (std::size_t s = 0; s < samples.image_idxs.size(); ++s) {
    if (features.images[samples.image_idxs[s]].keypoints.empty()) continue;
    kept.push_back(samples.image_idxs[s]);
    groups.push_back(samples.group_of[s]);
  }
  samples.image_idxs = kept;
  samples.group_of = groups;
  return features;
}

// Everything of one split that methods are trained on and asked for.
struct SplitData {
  Labels labels;  // of the training samples
  std::vector<Histogram> training;
  Eigen::MatrixXf gram;
  std::vector<Histogram> tests;
  std::vector<Truth> truths;
};

std::vector<Histogram> FrameHistograms(const FeatureStore& features, const std::vector<int>& idxs,
                                       const Vocabulary& vocabulary,
                                       const ExperimentOptions& options) {
  std::vector<Histogram> histograms;
  for (ImageHistograms& h : BuildHistograms(features, idxs, vocabulary,
                                            std::min(options.words_per_feature, options.num_words),
                                            options.histogram_map, options.jobs)) {
    histograms.push_back(std::move(h.frame));
  }
  return histograms;
}

Vocabulary MakeVocabulary(const FeatureStore& features, const std::vector<int>& idxs,
                          const ExperimentOptions& options) {
  std::vector<std::int8_t> all;
  for (const int i : idxs) {
    const auto& descriptors = features.images[i].descriptors;
    all.insert(all.end(), descriptors.begin(), descriptors.end());
  }
  const KMeansOptions clustering = {
      .num_words = options.num_words, .seed = options.seed, .jobs = options.jobs};
  return {ClusterDescriptors(all, features.dim, clustering).words, features.dim};
}

LabelOptions LabelsOfSplit(const Samples& samples, const ExperimentOptions& options) {
  LabelOptions labels = options.labels;
  if (samples.views_named) labels.views = LabelOptions::Views::kLabels;
  return labels;
}

SplitData PrepareSplit(const Samples& samples, const FeatureStore& features, const Split& split,
                       const ExperimentOptions& options, const ExperimentResult& result) {
  std::vector<int> training;
  std::vector<int> tests;
  for (std::size_t s = 0; s < split.size(); ++s) {
    (split[s] ? tests : training).push_back(samples.image_idxs[s]);
  }
  const Vocabulary vocabulary = MakeVocabulary(features, training, options);
  SplitData data;
  data.training = FrameHistograms(features, training, vocabulary, options);
  data.tests = FrameHistograms(features, tests, vocabulary, options);
  data.gram = GramMatrix(data.training, vocabulary.size(), options.jobs);
  data.labels = MakeLabels(samples.set, training, data.gram, LabelsOfSplit(samples, options));
  for (const int i : tests) {
    const ImageRecord& image = samples.set.images[i];
    data.truths.push_back(
        {i, IndexOf(result.locations, image.location), IndexOf(result.views, image.view)});
  }
  return data;
}

std::vector<std::unique_ptr<Method>> MakeMethods(const ExperimentResult& result) {
  std::vector<std::unique_ptr<Method>> methods;
  methods.push_back(std::make_unique<MultitaskSvm>());
  if (result.views.size() <= kMaxSingleViews) {
    for (int v = 0; v < static_cast<int>(result.views.size()); ++v) {
      methods.push_back(std::make_unique<SingleViewSvm>(result.views[v]));
    }
  }
  methods.push_back(std::make_unique<IndependentSvm>());
  methods.push_back(std::make_unique<PooledSvm>());
  methods.push_back(std::make_unique<OneVsRestSvm>());
  methods.push_back(std::make_unique<NearestNeighbour>());
  methods.push_back(std::make_unique<SparseTrace>());
  methods.push_back(std::make_unique<ClusteredLearning>());
  methods.push_back(std::make_unique<StructureLearning>());
  return methods;
}

std::vector<MethodResult> EmptyResults(const std::vector<std::unique_ptr<Method>>& methods,
                                       const std::vector<std::string>& views) {
  std::vector<MethodResult> results;
  for (const auto& method : methods) {
    MethodResult result;
    result.name = method->name();
    result.tells_views = method->tells_views();
    if (const auto* single = dynamic_cast<const SingleViewSvm*>(method.get())) {
      result.own_view = IndexOf(views, single->view());
    }
    for (const Parameter& p : method->parameters()) result.parameter_names.push_back(p.name);
    results.push_back(std::move(result));
  }
  return results;
}

// A split numbers its locations and views itself: by name into those of the whole experiment.
Answer Renumbered(const Answer& answer, const Labels& labels, const ExperimentResult& result) {
  return {answer.location < 0 ? -1 : IndexOf(result.locations, labels.locations[answer.location]),
          answer.view < 0 ? -1 : IndexOf(result.views, labels.views[answer.view])};
}

// What the method called `name` chose in this split; null: there is none.
const Selection* ChoiceOf(const std::string& name, const ExperimentResult& result) {
  for (const MethodResult& method : result.methods) {
    if (method.name == name) return &method.selections.back();
  }
  return nullptr;
}

using Predictors = std::vector<std::unique_ptr<Predictor>>;

// Trains and asks every method; what they are then is returned.
Predictors RunSplit(const std::vector<std::unique_ptr<Method>>& methods, const SplitData& data,
                    const ExperimentOptions& options, const Progress& progress,
                    ExperimentResult& result) {
  const TrainingData training = {data.labels, data.training, data.gram, options.num_words,
                                 std::vector<bool>(data.training.size(), true)};
  const int total = static_cast<int>(methods.size()) * kTicks;
  Predictors predictors;
  for (std::size_t m = 0; m < methods.size(); ++m) {
    const int before = static_cast<int>(m) * kTicks;
    const Progress part = [&](int done, int of) {
      if (progress) progress(before + kTicks * done / (of + 1), total);
    };
    const Selection* const known = ChoiceOf(methods[m]->chooses_as(), result);
    const Selection selection =
        known != nullptr
            ? *known
            : SelectParameters(*methods[m], training, options.folds, options.jobs, part);
    predictors.push_back(methods[m]->Train(training, selection.values));
    std::vector<Answer> answers;
    for (const Histogram& h : data.tests) {
      answers.push_back(Renumbered(predictors.back()->Predict(h), data.labels, result));
    }
    result.methods[m].selections.push_back(selection);
    result.methods[m].answers.push_back(std::move(answers));
    if (progress) progress(before + kTicks, total);
  }
  return predictors;
}

// The location whose scores are shown, the paper's if the set has it.
int ShownLocation(const ExperimentResult& result) {
  for (int l = 0; l < static_cast<int>(result.locations.size()); ++l) {
    const std::string& name = result.locations[l];
    if (name.substr(name.rfind('/') + 1) == "lobby") return l;
  }
  return 0;
}

ScoreTable MakeScoreTable(const Predictor& predictor, const SplitData& data,
                          const ExperimentResult& result) {
  ScoreTable table;
  const auto* linear = dynamic_cast<const LinearPredictor*>(&predictor);
  if (linear == nullptr) return table;
  table.location = ShownLocation(result);
  for (std::size_t c = 0; c < linear->column_location().size(); ++c) {
    const Answer column =
        Renumbered({linear->column_location()[c], linear->column_view()[c]}, data.labels, result);
    table.column_location.push_back(column.location);
    table.column_view.push_back(column.view);
  }
  for (std::size_t i = 0; i < data.tests.size(); ++i) {
    const Truth& truth = data.truths[i];
    if (truth.location != table.location) continue;
    table.rows.push_back({truth.image_idx, truth.view, linear->Scores(data.tests[i])});
  }
  return table;
}

// What libsvm itself takes where this program takes one dot product a location.
std::unique_ptr<Predictor> LibsvmItself(const SplitData& data, const ExperimentResult& result) {
  for (const MethodResult& method : result.methods) {
    if (method.name != OneVsRestSvm().name()) continue;
    return TrainLibsvmOneVsRest(data.training, data.labels.location,
                                static_cast<int>(data.labels.locations.size()),
                                method.selections.back().values.front());
  }
  return nullptr;
}

// Of the last split.
void MeasureCosts(Predictors predictors, const SplitData& data, ExperimentResult& result) {
  const std::vector<Histogram>& tests = data.tests;
  predictors.push_back(LibsvmItself(data, result));
  const std::vector<PredictionTime> times = MeasurePredictionTimes(predictors, tests);
  const auto cost_of = [&](std::size_t p) {
    PredictionCost cost = {times[p]};
    for (const Histogram& h : tests) cost.multiply_adds += predictors[p]->MultiplyAdds(h);
    cost.multiply_adds /= static_cast<double>(std::max<std::size_t>(1, tests.size()));
    return cost;
  };
  for (std::size_t m = 0; m < result.methods.size(); ++m) result.methods[m].cost = cost_of(m);
  result.libsvm_cost = cost_of(result.methods.size());
}

void CheckLocations(const Samples& samples, const ExperimentResult& result) {
  if (result.locations.size() >= 2) return;
  throw ToolError(samples.set.source.string() +
                  ": fewer than two locations: at least two are needed to tell apart");
}

void CheckTests(const Samples& samples, const std::vector<Split>& splits) {
  for (const Split& split : splits) {
    if (std::count(split.begin(), split.end(), true) > 0) continue;
    throw ToolError(samples.set.source.string() +
                    ": no image is left for testing: locations need three images or more");
  }
}

}  // namespace

ExperimentResult RunExperiment(const ImageSet& set, const ExperimentOptions& options,
                               const StageProgress& stages) {
  ExperimentResult result;
  Samples samples = ChooseSamples(set, options);
  result.location_source = samples.location_source;
  result.view_source = samples.view_source;
  result.locations = Names(samples, &ImageRecord::location);
  result.views = Names(samples, &ImageRecord::view);
  CheckLocations(samples, result);
  const FeatureStore features = FindFeatures(samples, options, stages, result);
  result.samples = static_cast<int>(samples.image_idxs.size());

  Split own;
  for (const int i : samples.image_idxs) own.push_back(set.images[i].is_test);
  result.drawn_as_runs = samples.view_source != "labels";
  const SplitOptions draw = {
      .count = options.splits, .as_runs = result.drawn_as_runs, .seed = options.seed};
  const std::vector<Split> splits = DrawSplits(samples.group_of, own, draw);
  result.first_split_is_own = splits.front() == own;
  CheckTests(samples, splits);

  const auto methods = MakeMethods(result);
  result.methods = EmptyResults(methods, result.views);
  for (std::size_t i = 0; i < splits.size(); ++i) {
    const Progress progress =
        Begin(stages, "split " + std::to_string(i + 1) + " of " + std::to_string(splits.size()));
    const SplitData data = PrepareSplit(samples, features, splits[i], options, result);
    result.truths.push_back(data.truths);
    Predictors predictors = RunSplit(methods, data, options, progress, result);
    if (i == 0) result.scores = MakeScoreTable(*predictors.front(), data, result);
    if (i + 1 == splits.size()) MeasureCosts(std::move(predictors), data, result);
  }
  return result;
}

}  // namespace viewfix
