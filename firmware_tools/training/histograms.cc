// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/histograms.h"

namespace viewfix {

std::vector<Histogram> BuildHistograms(const FeatureStore& store, std::span<const int> image_idxs,
                                       const Vocabulary& vocabulary, HistogramMap map, int jobs,
                                       const Progress& progress) {
  const int max_features = store.options.max_features;
  std::vector<HistogramBuilder> builders;
  for (int w = 0; w < Workers(jobs); ++w) {
    builders.emplace_back(vocabulary.size(), max_features, map);
  }
  std::vector<Histogram> histograms(image_idxs.size());
  const auto build = [&](int i, int worker) {
    const ImageFeatures& image = store.images[image_idxs[i]];
    std::vector<std::uint16_t> words(image.keypoints.size());
    vocabulary.NearestWords(image.descriptors, words);
    builders[worker].Build(words, histograms[i]);
  };
  ParallelForWorkers(static_cast<int>(image_idxs.size()), jobs, build, progress);
  return histograms;
}

Eigen::MatrixXf GramMatrix(std::span<const Histogram> histograms, int num_words, int jobs) {
  const int n = static_cast<int>(histograms.size());
  Eigen::MatrixXf gram(n, n);
  ParallelFor(n, jobs, [&](int i) {
    std::vector<float> dense(num_words, 0.0F);
    for (int e = 0; e < histograms[i].size(); ++e) {
      dense[histograms[i].words[e]] = histograms[i].values[e];
    }
    for (int j = 0; j < n; ++j) {
      float dot = 0;
      for (int e = 0; e < histograms[j].size(); ++e) {
        dot += dense[histograms[j].words[e]] * histograms[j].values[e];
      }
      gram(j, i) = dot;
    }
  });
  return gram.selfadjointView<Eigen::Lower>();
}

}  // namespace viewfix
