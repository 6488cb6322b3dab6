// SPDX-License-Identifier: BSD-3-Clause
#include "engine/scoring/scoring.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace viewfix {

namespace {

constexpr int kPairBlock = 8192;   // sums that stay in the nearest caches
constexpr int kWordsTogether = 4;  // for one reading and writing of a sum

// Adds kWordsTogether words' weights to the sums of a block of pairs, word after word.
struct AddWordsKernel {
  VIEWFIX_KERNEL void Run(const std::int8_t* const* rows, const float* values, int num_pairs,
                          float* out) {
    float* __restrict sums = out;
    const std::int8_t *row0 = rows[0], *row1 = rows[1], *row2 = rows[2], *row3 = rows[3];
    const float value0 = values[0], value1 = values[1], value2 = values[2], value3 = values[3];
    for (int p = 0; p < num_pairs; ++p) {
      float sum = sums[p];
      sum += value0 * static_cast<float>(row0[p]);
      sum += value1 * static_cast<float>(row1[p]);
      sum += value2 * static_cast<float>(row2[p]);
      sum += value3 * static_cast<float>(row3[p]);
      sums[p] = sum;
    }
  }
};

struct AddWordKernel {
  VIEWFIX_KERNEL void Run(const std::int8_t* row, float value, int num_pairs, float* out) {
    float* __restrict sums = out;
    for (int p = 0; p < num_pairs; ++p) sums[p] += value * static_cast<float>(row[p]);
  }
};

void SumBlock(const ModelScoring& model, const Histogram& histogram, int first_pair, int num_pairs,
              CpuPath path, float* sums) {
  const auto row = [&](int i) {
    return &model.weights[std::size_t(histogram.words[i]) * model.num_pairs + first_pair];
  };
  int i = 0;
  for (; i + kWordsTogether <= histogram.size(); i += kWordsTogether) {
    const std::int8_t* const rows[kWordsTogether] = {row(i), row(i + 1), row(i + 2), row(i + 3)};
    RunOnPath<AddWordsKernel>(path, &rows[0], &histogram.values[i], num_pairs, sums);
  }
  for (; i < histogram.size(); ++i) {
    RunOnPath<AddWordKernel>(path, row(i), histogram.values[i], num_pairs, sums);
  }
}

}  // namespace

void ScorePairs(const ModelScoring& model, const Histogram& histogram, std::span<float> scores,
                CpuPath path) {
  const int num_pairs = model.num_pairs;
  float* const sums = scores.data();
  std::fill_n(sums, num_pairs, 0.0F);
  for (int first = 0; first < num_pairs; first += kPairBlock) {
    SumBlock(model, histogram, first, std::min(kPairBlock, num_pairs - first), path, sums + first);
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
