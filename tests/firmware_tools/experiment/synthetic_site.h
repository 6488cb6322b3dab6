// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <random>
#include <vector>

#include "firmware_tools/experiment/method.h"
#include "firmware_tools/training/histograms.h"

namespace viewfix::testing {

// Four locations of three views, eight images each: words drawn from the location's, the view's
// and everyone's part of the vocabulary.
struct ExperimentSite {
  static constexpr int kWords = 60;
  static constexpr int kLocations = 4;
  static constexpr int kViews = 3;
  static constexpr int kImages = 8;
  Labels labels;
  std::vector<Histogram> histograms;
  Eigen::MatrixXf gram;

  explicit ExperimentSite(unsigned seed = 5) {
    std::mt19937 random(seed);
    HistogramBuilder builder(kWords, 120, 1, HistogramMap::kHellinger);
    labels.locations = {"a", "b", "c", "d"};
    labels.views = {"left", "middle", "right"};
    labels.global_views = true;
    for (int p = 0; p < kLocations * kViews; ++p) {
      labels.pair_location.push_back(p / kViews);
      labels.pair_view.push_back(p % kViews);
      for (int i = 0; i < kImages; ++i) AddImage(p, random, builder);
    }
    gram = GramMatrix(histograms, kWords, 1);
  }

  // All samples, or all but each fourth.
  TrainingData Data(bool all = true) const {
    TrainingData data = {labels, histograms, gram, kWords,
                         std::vector<bool>(histograms.size(), true)};
    for (std::size_t s = 0; !all && s < data.used.size(); s += 4) data.used[s] = false;
    return data;
  }

  int ViewOf(int sample) const { return labels.pair_view[labels.pair[sample]]; }

 private:
  void AddImage(int pair, std::mt19937& random, HistogramBuilder& builder) {
    std::vector<std::uint16_t> words;
    for (int w = 0; w < 120; ++w) {
      const auto kind = random() % 4;
      const auto word = kind == 0   ? 6 * (pair / kViews) + random() % 6
                        : kind == 1 ? 24 + 4 * (pair % kViews) + random() % 4
                                    : random() % kWords;
      words.push_back(static_cast<std::uint16_t>(word));
    }
    histograms.emplace_back();
    builder.Build(words, histograms.back());
    labels.image_idxs.push_back(static_cast<int>(labels.image_idxs.size()));
    labels.location.push_back(pair / kViews);
    labels.pair.push_back(pair);
  }
};

}  // namespace viewfix::testing
