// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/experiment/selection.h"

#include <algorithm>

#include "firmware_tools/training/score_training.h"

namespace viewfix {
namespace {

struct Count {
  int asked = 0;
  int location = 0;
  int view = 0;
};

// Trains without one fold and asks for its samples.
Count RunFold(const Method& method, const TrainingData& all, const std::vector<int>& fold_of,
              int fold, std::span<const double> values) {
  TrainingData data = all;
  for (std::size_t s = 0; s < data.used.size(); ++s) {
    data.used[s] = data.used[s] && fold_of[s] != fold;
  }
  const auto predictor = method.Train(data, values);
  Count count;
  for (std::size_t s = 0; s < data.used.size(); ++s) {
    if (!all.used[s] || fold_of[s] != fold) continue;
    const Answer answer = predictor->Predict(data.histograms[s]);
    ++count.asked;
    count.location += answer.location == data.labels.location[s] ? 1 : 0;
    count.view += answer.view == data.labels.pair_view[data.labels.pair[s]] ? 1 : 0;
  }
  return count;
}

}  // namespace

Selection SelectParameters(const Method& method, const TrainingData& data, int folds, int jobs,
                           const Progress& progress) {
  const std::vector<Parameter> parameters = method.parameters();
  const std::vector<int> fold_of = HeldOutBlocks(data.labels, folds);
  const bool views_count = method.tells_views() && data.labels.global_views;
  int total = folds;
  for (const Parameter& p : parameters) total += folds * (static_cast<int>(p.values.size()) - 1);
  int finished = 0;

  // Merit of each candidate, all folds of all candidates side by side.
  const auto measure = [&](const std::vector<std::vector<double>>& candidates) {
    const int runs = static_cast<int>(candidates.size()) * folds;
    std::vector<Count> counts(runs);
    ParallelFor(
        runs, jobs,
        [&](int r) {
          counts[r] = RunFold(method, data, fold_of, r % folds, candidates[r / folds]);
        },
        [&](int done, int) {
          if (progress) progress(finished + done, total);
        });
    finished += runs;
    std::vector<double> merits;
    for (std::size_t c = 0; c < candidates.size(); ++c) {
      Count sum;
      for (int f = 0; f < folds; ++f) {
        const Count& count = counts[c * folds + f];
        sum.asked += count.asked;
        sum.location += count.location;
        sum.view += views_count ? count.view : 0;
      }
      merits.push_back(static_cast<double>(sum.location + sum.view) / std::max(1, sum.asked));
    }
    return merits;
  };

  Selection best;
  for (const Parameter& p : parameters) best.values.push_back(p.start);
  if (parameters.empty()) return best;
  best.merit = measure({best.values}).front();
  for (std::size_t p = 0; p < parameters.size(); ++p) {
    std::vector<std::vector<double>> candidates;
    for (const double value : parameters[p].values) {
      if (value == best.values[p]) continue;
      candidates.push_back(best.values);
      candidates.back()[p] = value;
    }
    const std::vector<double> merits = measure(candidates);
    for (std::size_t c = 0; c < candidates.size(); ++c) {
      if (merits[c] > best.merit) best = {candidates[c], merits[c]};
    }
  }
  return best;
}

}  // namespace viewfix
