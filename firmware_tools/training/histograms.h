// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "engine/vocabulary/vocabulary.h"
#include "firmware_tools/training/feature_store.h"

namespace viewfix {

// One histogram for each of `image_idxs`, in that order.
std::vector<Histogram> BuildHistograms(const FeatureStore& store, std::span<const int> image_idxs,
                                       const Vocabulary& vocabulary, HistogramMap map, int jobs,
                                       const Progress& progress = {});

// Dot products of all histograms: [n, n], the linear kernel K of eq. (3) of the method in
// the mapped space.
Eigen::MatrixXf GramMatrix(std::span<const Histogram> histograms, int num_words, int jobs);

}  // namespace viewfix
