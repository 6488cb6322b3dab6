// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "engine/vocabulary/vocabulary.h"
#include "firmware_tools/training/feature_store.h"

namespace viewfix {

// An image's histogram as the board makes it of a frame, and as the model keeps it of a
// keyframe: there each feature counts for its nearest word alone, which takes half the bytes
// and finds the same places.
struct ImageHistograms {
  Histogram frame;
  Histogram keyframe;
};

// Those of each of `image_idxs`, in that order.
std::vector<ImageHistograms> BuildHistograms(const FeatureStore& store,
                                             std::span<const int> image_idxs,
                                             const Vocabulary& vocabulary, int words_per_feature,
                                             HistogramMap map, int jobs,
                                             const Progress& progress = {});

// Dot products of all histograms: [n, n], the linear kernel K of eq. (3) of the method in
// the mapped space.
Eigen::MatrixXf GramMatrix(std::span<const Histogram> histograms, int num_words, int jobs);

// s(k, i): similarity of keyframe k to frame i as Retrieval::Similarities() has it, [n, n].
Eigen::MatrixXf KeyframeSimilarities(std::span<const Histogram> frames,
                                     std::span<const Histogram> keyframes, int num_words, int jobs);

}  // namespace viewfix
