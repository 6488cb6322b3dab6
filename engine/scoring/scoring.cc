// SPDX-License-Identifier: BSD-3-Clause
#include "engine/scoring/scoring.h"

#include <algorithm>
#include <limits>

namespace viewfix {

void ScorePairs(const ModelScoring& model, const Histogram& histogram, std::span<float> scores) {
  const int num_pairs = model.num_pairs;
  float* const sums = scores.data();
  std::fill_n(sums, num_pairs, 0.0F);
  for (int i = 0; i < histogram.size(); ++i) {
    const float value = histogram.values[i];
    const std::int8_t* row = &model.weights[std::size_t(histogram.words[i]) * num_pairs];
    for (int p = 0; p < num_pairs; ++p) sums[p] += value * static_cast<float>(row[p]);
  }
  for (int p = 0; p < num_pairs; ++p) {
    sums[p] = model.bias[p] + model.weight_scale[p] * sums[p];
  }
}

void AddKeyframeSimilarity(const ModelScoring& model, const ModelKeyframes& keyframes,
                           std::span<const float> similarities, std::span<float> pair_scores) {
  int k = 0;
  for (int p = 0; p < model.num_pairs; ++p) {
    float best = kNoSimilarity;
    for (; k < keyframes.size && keyframes.pair[k] == p; ++k) {
      best = std::max(best, similarities[k]);
    }
    pair_scores[p] += model.keyframe_weight * best;
  }
}

void LikenessOfLocations(const ModelScoring& model, const ModelKeyframes& keyframes,
                         std::span<const float> similarities, std::span<float> likeness) {
  std::fill(likeness.begin(), likeness.end(), kNoSimilarity);
  for (int k = 0; k < keyframes.size; ++k) {
    float& best = likeness[model.pair_location[keyframes.pair[k]]];
    best = std::max(best, similarities[k]);
  }
}

void ScoreLocations(const ModelScoring& model, std::span<const float> pair_scores,
                    std::span<float> location_scores) {
  const bool sum = model.location_rule == LocationRule::kSumOfPairs;
  const float start = sum ? 0.0F : std::numeric_limits<float>::lowest();
  std::fill(location_scores.begin(), location_scores.end(), start);
  for (int p = 0; p < model.num_pairs; ++p) {
    float& score = location_scores[model.pair_location[p]];
    score = sum ? score + pair_scores[p] : std::max(score, pair_scores[p]);
  }
}

int BestPairOf(const ModelScoring& model, std::span<const float> pair_scores, int location_idx) {
  int best = -1;
  for (int p = 0; p < model.num_pairs; ++p) {
    if (model.pair_location[p] != location_idx) continue;
    if (best < 0 || pair_scores[p] > pair_scores[best]) best = p;
  }
  return best;
}

}  // namespace viewfix
