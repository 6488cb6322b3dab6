// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/experiment/nearest_neighbour.h"

#include <algorithm>

namespace viewfix {
namespace {

// |x - k|^2 is least where x'k - |k|^2 / 2 is largest. All training images side by side for
// each word: the same inner loop as LinearPredictor has.
class NearestPredictor : public Predictor {
 public:
  explicit NearestPredictor(const TrainingData& data) {
    const std::vector<int> samples = data.UsedSamples();
    weights_.assign(samples.size() * data.num_words, 0.0F);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const int s = samples[i];
      const Histogram& h = data.histograms[s];
      answers_.push_back({data.labels.location[s], data.labels.pair_view[data.labels.pair[s]]});
      float norm2 = 0;
      for (int e = 0; e < h.size(); ++e) {
        weights_[h.words[e] * samples.size() + i] = h.values[e];
        norm2 += h.values[e] * h.values[e];
      }
      start_.push_back(-0.5F * norm2);
    }
  }

  Answer Predict(const Histogram& histogram) const override {
    std::vector<float> scores = start_;
    for (int e = 0; e < histogram.size(); ++e) {
      const float value = histogram.values[e];
      const float* weights = weights_.data() + histogram.words[e] * scores.size();
      for (std::size_t i = 0; i < scores.size(); ++i) scores[i] += value * weights[i];
    }
    return answers_[std::max_element(scores.begin(), scores.end()) - scores.begin()];
  }

  double MultiplyAdds(const Histogram& histogram) const override {
    return static_cast<double>(histogram.size()) * static_cast<double>(start_.size());
  }

 private:
  std::vector<Answer> answers_;  // [training images]
  std::vector<float> start_;     // [training images] -|k|^2 / 2
  std::vector<float> weights_;   // [words, training images]
};

}  // namespace

std::unique_ptr<Predictor> NearestNeighbour::Train(const TrainingData& data,
                                                   std::span<const double> /*values*/) const {
  return std::make_unique<NearestPredictor>(data);
}

}  // namespace viewfix
