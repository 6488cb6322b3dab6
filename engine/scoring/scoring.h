// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "engine/base/cpu_path.h"
#include "engine/vocabulary/vocabulary.h"
#include "models/model_view.h"

namespace viewfix {

// Correlation scores of every (location, view), eq. (5) of the method:
//   f_p = bias_p + weight_scale_p * sum_w h_w weight_{w,p}
// Lane-wise float arithmetic over pairs, words ascending: the same bits everywhere.
//   scores [pairs]. No allocation.
void ScorePairs(const ModelScoring& model, const Histogram& histogram, std::span<float> scores,
                CpuPath path = BestCpuPath());

// Adds to each pair's score what its most similar keyframe says:
//   f'_p = f_p + keyframe_weight * max_k s_k over the keyframes k of pair p,
// s_k as Retrieval::Similarities() gives it; a pair without keyframes adds kNoSimilarity.
//   similarities [keyframes], pair_scores [pairs]. No allocation.
inline constexpr float kNoSimilarity = -0.5F;  // of histograms that share no word
void AddKeyframeSimilarity(const ModelScoring& model, const ModelKeyframes& keyframes,
                           std::span<const float> similarities, std::span<float> pair_scores);

// How like the frame the most similar keyframe of each location is; kNoSimilarity without any.
//   similarities [keyframes], likeness [locations]. No allocation.
void LikenessOfLocations(const ModelScoring& model, const ModelKeyframes& keyframes,
                         std::span<const float> similarities, std::span<float> likeness);

// A location's score from its pairs' scores, by the model's rule.
//   pair_scores [pairs], location_scores [locations]. No allocation.
void ScoreLocations(const ModelScoring& model, std::span<const float> pair_scores,
                    std::span<float> location_scores);

// The pair of `location_idx` that scores highest; the lowest index among equals.
int BestPairOf(const ModelScoring& model, std::span<const float> pair_scores, int location_idx);

}  // namespace viewfix
