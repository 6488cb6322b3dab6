// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/histograms.h"

namespace viewfix {
namespace {

std::vector<float> Dense(const Histogram& histogram, int num_words) {
  std::vector<float> dense(num_words, 0.0F);
  for (int e = 0; e < histogram.size(); ++e) dense[histogram.words[e]] = histogram.values[e];
  return dense;
}

float Dot(const std::vector<float>& dense, const Histogram& histogram) {
  float dot = 0;
  for (int e = 0; e < histogram.size(); ++e) dot += dense[histogram.words[e]] * histogram.values[e];
  return dot;
}

float SquaredNorm(const Histogram& histogram) {
  float sum = 0;
  for (const float value : histogram.values) sum += value * value;
  return sum;
}

std::vector<std::uint16_t> NearestOnly(std::span<const std::uint16_t> words, int per_feature) {
  std::vector<std::uint16_t> nearest;
  for (std::size_t i = 0; i < words.size(); i += per_feature) nearest.push_back(words[i]);
  return nearest;
}

}  // namespace

std::vector<ImageHistograms> BuildHistograms(const FeatureStore& store,
                                             std::span<const int> image_idxs,
                                             const Vocabulary& vocabulary, int words_per_feature,
                                             HistogramMap map, int jobs, const Progress& progress) {
  const int max_features = store.options.max_features;
  std::vector<HistogramBuilder> frame_builders;
  std::vector<HistogramBuilder> keyframe_builders;
  for (int w = 0; w < Workers(jobs); ++w) {
    frame_builders.emplace_back(vocabulary.size(), max_features, words_per_feature, map);
    keyframe_builders.emplace_back(vocabulary.size(), max_features, 1, map);
  }
  std::vector<ImageHistograms> histograms(image_idxs.size());
  const auto build = [&](int i, int worker) {
    const ImageFeatures& image = store.images[image_idxs[i]];
    std::vector<std::uint16_t> words(image.keypoints.size() * words_per_feature);
    vocabulary.NearestWords(image.descriptors, words_per_feature, words);
    frame_builders[worker].Build(words, histograms[i].frame);
    keyframe_builders[worker].Build(NearestOnly(words, words_per_feature), histograms[i].keyframe);
  };
  ParallelForWorkers(static_cast<int>(image_idxs.size()), jobs, build, progress);
  return histograms;
}

Eigen::MatrixXf GramMatrix(std::span<const Histogram> histograms, int num_words, int jobs) {
  const int n = static_cast<int>(histograms.size());
  Eigen::MatrixXf gram(n, n);
  ParallelFor(n, jobs, [&](int i) {
    const std::vector<float> dense = Dense(histograms[i], num_words);
    for (int j = 0; j < n; ++j) gram(j, i) = Dot(dense, histograms[j]);
  });
  return gram.selfadjointView<Eigen::Lower>();
}

Eigen::MatrixXf KeyframeSimilarities(std::span<const Histogram> frames,
                                     std::span<const Histogram> keyframes, int num_words,
                                     int jobs) {
  const int n = static_cast<int>(frames.size());
  Eigen::MatrixXf similarities(n, n);
  ParallelFor(n, jobs, [&](int i) {
    const std::vector<float> dense = Dense(frames[i], num_words);
    for (int k = 0; k < n; ++k) {
      similarities(k, i) = Dot(dense, keyframes[k]) - 0.5F * SquaredNorm(keyframes[k]);
    }
  });
  return similarities;
}

}  // namespace viewfix
