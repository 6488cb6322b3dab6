// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/experiment/multitask_methods.h"

#include <algorithm>

#include "firmware_tools/experiment/location_pairs.h"
#include "firmware_tools/training/score_training.h"

namespace viewfix {
namespace {

// Within training: well below what moves a decision. Tests go to 1e-7.
ProximalOptions TrainingTolerance() {
  ProximalOptions options;
  options.max_iterations = 400;
  options.tolerance = 5e-4;
  return options;
}

struct LocationTasks {
  LearningTasks tasks;     // samples less their mean
  Eigen::VectorXd mean;    // [words]
  std::vector<int> views;  // [tasks]
};

// Of what LocationVariables() lets take part; without the tasks that lack positives or negatives.
LocationTasks MakeTasks(const TrainingData& data, const std::vector<int>& pairs,
                        std::span<const DualVariable> variables) {
  const std::vector<int> samples = data.UsedSamples();
  std::vector<Eigen::Index> column_of(data.used.size(), 0);
  LocationTasks made;
  const auto n = static_cast<Eigen::Index>(samples.size());
  Eigen::MatrixXd histograms = Eigen::MatrixXd::Zero(data.num_words, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    column_of[samples[i]] = i;
    const Histogram& h = data.histograms[samples[i]];
    for (int e = 0; e < h.size(); ++e) histograms(h.words[e], i) = double{h.values[e]};
  }
  // The bias, which no penalty touches, takes up the mean: the same problem, but histograms, whose
  // numbers are all positive, no longer point in one direction, and it converges sooner.
  made.mean = histograms.rowwise().mean();
  made.tasks.samples = (histograms.colwise() - made.mean).cast<float>();
  Eigen::MatrixXd labels = Eigen::MatrixXd::Zero(n, static_cast<Eigen::Index>(pairs.size()));
  for (const DualVariable& v : variables) labels(column_of[v.sample_idx], v.task) = v.label;
  std::vector<Eigen::Index> kept;
  for (Eigen::Index t = 0; t < labels.cols(); ++t) {
    if (n == 0 || labels.col(t).minCoeff() >= 0 || labels.col(t).maxCoeff() <= 0) continue;
    kept.push_back(t);
    made.views.push_back(data.labels.pair_view[pairs[t]]);
  }
  made.tasks.labels = labels(Eigen::all, kept);
  return made;
}

}  // namespace

std::vector<Parameter> MultitaskRival::parameters() const {
  std::vector<Parameter> all = OwnParameters();
  all.push_back({"other_views_negative", {0, 1}, 0});
  all.push_back({"sum_rule", {0, 1}, 0});
  return all;
}

std::unique_ptr<Predictor> MultitaskRival::Train(const TrainingData& data,
                                                 std::span<const double> values) const {
  const std::size_t own = values.size() - 2;
  ScoreOptions roles;
  roles.other_views_negative = values[own] != 0;
  const int locations = static_cast<int>(data.labels.locations.size());
  std::vector<LinearPredictor::Column> columns;
  for (int l = 0; l < locations; ++l) {
    const std::vector<int> pairs = PairsOf(data.labels, l);
    const auto variables = LocationVariables(data.labels, pairs, data.used, roles);
    const auto [tasks, mean, views] = MakeTasks(data, pairs, variables);
    if (views.empty()) continue;
    const MultitaskWeights weights = Solve(tasks, values.first(own));
    for (std::size_t t = 0; t < views.size(); ++t) {
      const auto col = static_cast<Eigen::Index>(t);
      const Eigen::VectorXd w = weights.w.col(col);
      columns.push_back({l, views[t], weights.b[col] - w.dot(mean), w});
    }
  }
  const ColumnRule rule = values[own + 1] != 0 ? ColumnRule::kSum : ColumnRule::kBest;
  return std::make_unique<LinearPredictor>(columns, data.num_words, locations, rule);
}

std::vector<Parameter> SparseTrace::OwnParameters() const {
  return {{"gamma", {1e-6, 1e-5, 1e-4, 1e-3}, 1e-4}, {"tau", {10, 30, 100, 300}, 30}};
}

MultitaskWeights SparseTrace::Solve(const LearningTasks& tasks,
                                    std::span<const double> values) const {
  return SolveSparseTrace(tasks, values[0], values[1], TrainingTolerance());
}

std::vector<Parameter> ClusteredLearning::OwnParameters() const {
  return {
      {"rho", {1e-7, 1e-6, 1e-5, 1e-4, 1e-3}, 1e-5}, {"eta", {0.1, 1, 10}, 1}, {"k", {1, 2}, 1}};
}

MultitaskWeights ClusteredLearning::Solve(const LearningTasks& tasks,
                                          std::span<const double> values) const {
  const double k = std::min(values[2], static_cast<double>(tasks.labels.cols()));
  return SolveClustered(tasks, values[0], values[1], k, TrainingTolerance());
}

std::vector<Parameter> StructureLearning::OwnParameters() const {
  return {
      {"rho", {1e-7, 1e-6, 1e-5, 1e-4, 1e-3}, 1e-5}, {"eta", {0.1, 1, 10}, 1}, {"h", {1, 2}, 1}};
}

MultitaskWeights StructureLearning::Solve(const LearningTasks& tasks,
                                          std::span<const double> values) const {
  return SolveStructure(tasks, values[0], values[1], values[2], TrainingTolerance());
}

}  // namespace viewfix
