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
  options.max_iterations = 200;
  options.tolerance = 5e-4;
  return options;
}

LearningTask MakeTask(const TrainingData& data, std::span<const DualVariable> variables, int task) {
  std::vector<const DualVariable*> own;
  for (const DualVariable& v : variables) {
    if (v.task == task) own.push_back(&v);
  }
  const auto n = static_cast<Eigen::Index>(own.size());
  LearningTask made = {Eigen::MatrixXd::Zero(data.num_words, n), Eigen::VectorXd(n)};
  for (Eigen::Index i = 0; i < n; ++i) {
    const Histogram& h = data.histograms[own[i]->sample_idx];
    for (int e = 0; e < h.size(); ++e) made.samples(h.words[e], i) = double{h.values[e]};
    made.labels[i] = own[i]->label;
  }
  return made;
}

bool HasBothLabels(const LearningTask& task) {
  return task.labels.size() > 0 && task.labels.minCoeff() < 0 && task.labels.maxCoeff() > 0;
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
    std::vector<LearningTask> tasks;
    std::vector<int> views;
    for (int t = 0; t < static_cast<int>(pairs.size()); ++t) {
      LearningTask task = MakeTask(data, variables, t);
      if (!HasBothLabels(task)) continue;
      tasks.push_back(std::move(task));
      views.push_back(data.labels.pair_view[pairs[t]]);
    }
    if (tasks.empty()) continue;
    const MultitaskWeights weights = Solve(tasks, values.first(own));
    for (std::size_t t = 0; t < tasks.size(); ++t) {
      const auto col = static_cast<Eigen::Index>(t);
      columns.push_back({l, views[t], weights.b[col], weights.w.col(col)});
    }
  }
  const ColumnRule rule = values[own + 1] != 0 ? ColumnRule::kSum : ColumnRule::kBest;
  return std::make_unique<LinearPredictor>(columns, data.num_words, locations, rule);
}

std::vector<Parameter> SparseTrace::OwnParameters() const {
  return {{"gamma", {1e-4, 3e-4, 1e-3, 3e-3}, 1e-3}, {"tau", {3, 10, 30, 100}, 10}};
}

MultitaskWeights SparseTrace::Solve(const std::vector<LearningTask>& tasks,
                                    std::span<const double> values) const {
  return SolveSparseTrace(tasks, values[0], values[1], TrainingTolerance());
}

std::vector<Parameter> ClusteredLearning::OwnParameters() const {
  return {{"rho", {1e-5, 1e-4, 1e-3, 1e-2}, 1e-4}, {"eta", {0.1, 1, 10}, 1}, {"k", {1, 2}, 1}};
}

MultitaskWeights ClusteredLearning::Solve(const std::vector<LearningTask>& tasks,
                                          std::span<const double> values) const {
  const double k = std::min(values[2], static_cast<double>(tasks.size()));
  return SolveClustered(tasks, values[0], values[1], k, TrainingTolerance());
}

std::vector<Parameter> StructureLearning::OwnParameters() const {
  return {{"rho", {1e-5, 1e-4, 1e-3, 1e-2}, 1e-4}, {"eta", {0.1, 1, 10}, 1}, {"h", {1, 2}, 1}};
}

MultitaskWeights StructureLearning::Solve(const std::vector<LearningTask>& tasks,
                                          std::span<const double> values) const {
  return SolveStructure(tasks, values[0], values[1], values[2], TrainingTolerance());
}

}  // namespace viewfix
