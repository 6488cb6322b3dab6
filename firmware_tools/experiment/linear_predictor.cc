// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/experiment/linear_predictor.h"

#include <limits>

namespace viewfix {
namespace {

constexpr float kMinusInfinity = -std::numeric_limits<float>::infinity();

}  // namespace

LinearPredictor::LinearPredictor(const std::vector<Column>& columns, int num_words,
                                 int num_locations, ColumnRule rule)
    : num_locations_(num_locations), rule_(rule) {
  weights_.resize(columns.size() * num_words);
  for (std::size_t c = 0; c < columns.size(); ++c) {
    location_.push_back(columns[c].location);
    view_.push_back(columns[c].view);
    bias_.push_back(static_cast<float>(columns[c].bias));
    for (int w = 0; w < num_words; ++w) {
      weights_[w * columns.size() + c] = static_cast<float>(columns[c].weights[w]);
    }
  }
}

std::vector<float> LinearPredictor::Scores(const Histogram& histogram) const {
  std::vector<float> scores = bias_;
  const std::size_t columns = scores.size();
  for (int e = 0; e < histogram.size(); ++e) {
    const float value = histogram.values[e];
    const float* weights = weights_.data() + histogram.words[e] * columns;
    for (std::size_t c = 0; c < columns; ++c) scores[c] += value * weights[c];
  }
  return scores;
}

Answer LinearPredictor::Predict(const Histogram& histogram) const {
  const std::vector<float> scores = Scores(histogram);
  std::vector<float> total(num_locations_, kMinusInfinity);
  std::vector<int> best(num_locations_, -1);
  for (int c = 0; c < static_cast<int>(scores.size()); ++c) {
    const int l = location_[c];
    const bool sum = rule_ == ColumnRule::kSum && best[l] >= 0;
    const bool is_best = best[l] < 0 || scores[c] > scores[best[l]];
    if (sum) {
      total[l] += scores[c];
    } else if (is_best) {
      total[l] = scores[c];
    }
    if (is_best) best[l] = c;
  }
  Answer answer;
  float highest = kMinusInfinity;
  for (int l = 0; l < num_locations_; ++l) {
    if (best[l] < 0 || !(total[l] > highest)) continue;
    highest = total[l];
    answer = {l, view_[best[l]]};
  }
  return answer;
}

double LinearPredictor::MultiplyAdds(const Histogram& histogram) const {
  return static_cast<double>(histogram.size()) * static_cast<double>(bias_.size());
}

Eigen::VectorXd SumOfSamples(std::span<const Histogram> histograms,
                             std::span<const std::pair<int, double>> terms, int num_words) {
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(num_words);
  for (const auto& [sample, coefficient] : terms) {
    const Histogram& h = histograms[sample];
    for (int e = 0; e < h.size(); ++e) weights[h.words[e]] += coefficient * double{h.values[e]};
  }
  return weights;
}

}  // namespace viewfix
