// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/experiment/svm_methods.h"

#include <algorithm>
#include <cmath>

#include "firmware_tools/experiment/libsvm.h"
#include "firmware_tools/experiment/location_pairs.h"
#include "firmware_tools/training/score_training.h"

namespace viewfix {
namespace {

using Column = LinearPredictor::Column;
using Columns = std::vector<Column>;
using Terms = std::vector<std::pair<int, double>>;

// Beta that stands for infinity: w_t is 1e-9 of what it would be alone.
constexpr double kPoolingBeta = 1e9;

Parameter Cost() { return {"c", SvmCosts(), ScoreOptions().c}; }
Parameter Negatives() { return {"other_views_negative", {0, 1}, 0}; }

int NumLocations(const TrainingData& data) {
  return static_cast<int>(data.labels.locations.size());
}

// The columns of one location's multi-task SVM, eq. (4) collapsed to eq. (5).
void AddColumns(const TrainingData& data, int location, const ScoreOptions& options,
                Columns& columns) {
  const LocationModel model = TrainLocation(data.labels, data.gram, location, data.used, options);
  Terms common;
  for (const LocationModel::Term& term : model.terms) {
    common.emplace_back(term.sample, term.coefficient);
  }
  const Eigen::VectorXd shared = SumOfSamples(data.histograms, common, data.num_words);
  for (int t = 0; t < static_cast<int>(model.pairs.size()); ++t) {
    if (std::isnan(model.bias[t])) continue;
    Terms own;
    for (const LocationModel::Term& term : model.terms) {
      if (term.task == t) own.emplace_back(term.sample, term.coefficient / model.beta);
    }
    columns.push_back({location, data.labels.pair_view[model.pairs[t]], model.bias[t],
                       shared + SumOfSamples(data.histograms, own, data.num_words)});
  }
}

std::unique_ptr<Predictor> TrainMultitask(const TrainingData& data, const ScoreOptions& options) {
  Columns columns;
  for (int l = 0; l < NumLocations(data); ++l) AddColumns(data, l, options, columns);
  const auto rule =
      options.rule == LocationRule::kSumOfPairs ? ColumnRule::kSum : ColumnRule::kBest;
  return std::make_unique<LinearPredictor>(columns, data.num_words, NumLocations(data), rule);
}

// Trains a column on samples of both labels; none where a label is missing.
void AddSvmColumn(const TrainingData& data, int location, int view, const std::vector<int>& samples,
                  const std::vector<int>& labels, double c, Columns& columns) {
  const auto positives = std::count(labels.begin(), labels.end(), 1);
  if (positives == 0 || positives == static_cast<std::ptrdiff_t>(labels.size())) return;
  const BinarySvm svm = TrainLibsvm(data.gram, samples, labels, c);
  columns.push_back(
      {location, view, svm.bias, SumOfSamples(data.histograms, svm.terms, data.num_words)});
}

// Each location against the others on `samples`.
std::unique_ptr<Predictor> TrainOneVsRest(const TrainingData& data, const std::vector<int>& samples,
                                          double c) {
  Columns columns;
  for (int l = 0; l < NumLocations(data); ++l) {
    std::vector<int> labels;
    for (const int s : samples) labels.push_back(data.labels.location[s] == l ? 1 : -1);
    AddSvmColumn(data, l, -1, samples, labels, c, columns);
  }
  return std::make_unique<LinearPredictor>(columns, data.num_words, NumLocations(data));
}

}  // namespace

std::vector<double> SvmCosts() { return {1, 3, 10, 30, 100}; }

std::vector<Parameter> MultitaskSvm::parameters() const {
  return {Cost(), Negatives(), {"beta", {0.03, 0.1, 0.3, 1, 3, 10}, 1}, {"sum_rule", {0, 1}, 0}};
}

std::unique_ptr<Predictor> MultitaskSvm::Train(const TrainingData& data,
                                               std::span<const double> values) const {
  ScoreOptions options;
  options.c = values[0];
  options.other_views_negative = values[1] != 0;
  options.beta = values[2];
  options.rule = values[3] != 0 ? LocationRule::kSumOfPairs : LocationRule::kBestPair;
  return TrainMultitask(data, options);
}

std::vector<Parameter> PooledSvm::parameters() const { return {Cost(), Negatives()}; }

std::unique_ptr<Predictor> PooledSvm::Train(const TrainingData& data,
                                            std::span<const double> values) const {
  ScoreOptions options;
  options.c = values[0];
  options.other_views_negative = values[1] != 0;
  options.beta = kPoolingBeta;
  return TrainMultitask(data, options);
}

std::vector<Parameter> IndependentSvm::parameters() const { return {Cost(), Negatives()}; }

std::unique_ptr<Predictor> IndependentSvm::Train(const TrainingData& data,
                                                 std::span<const double> values) const {
  ScoreOptions options;
  options.other_views_negative = values[1] != 0;
  Columns columns;
  for (int l = 0; l < NumLocations(data); ++l) {
    const std::vector<int> pairs = PairsOf(data.labels, l);
    const auto variables = LocationVariables(data.labels, pairs, data.used, options);
    for (int t = 0; t < static_cast<int>(pairs.size()); ++t) {
      std::vector<int> samples;
      std::vector<int> labels;
      for (const DualVariable& v : variables) {
        if (v.task != t) continue;
        samples.push_back(v.sample_idx);
        labels.push_back(v.label);
      }
      AddSvmColumn(data, l, data.labels.pair_view[pairs[t]], samples, labels, values[0], columns);
    }
  }
  return std::make_unique<LinearPredictor>(columns, data.num_words, NumLocations(data));
}

std::vector<Parameter> SingleViewSvm::parameters() const { return {Cost()}; }

std::unique_ptr<Predictor> SingleViewSvm::Train(const TrainingData& data,
                                                std::span<const double> values) const {
  std::vector<int> samples;
  for (const int s : data.UsedSamples()) {
    if (data.labels.views[data.labels.pair_view[data.labels.pair[s]]] == view_)
      samples.push_back(s);
  }
  return TrainOneVsRest(data, samples, values[0]);
}

std::vector<Parameter> OneVsRestSvm::parameters() const { return {Cost()}; }

std::unique_ptr<Predictor> OneVsRestSvm::Train(const TrainingData& data,
                                               std::span<const double> values) const {
  return TrainOneVsRest(data, data.UsedSamples(), values[0]);
}

}  // namespace viewfix
