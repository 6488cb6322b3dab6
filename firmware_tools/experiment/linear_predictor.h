// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <span>
#include <utility>
#include <vector>

#include "firmware_tools/experiment/method.h"

namespace viewfix {

// How the scores of a location's columns make the location's score.
enum class ColumnRule { kBest, kSum };

// Scores that are dot products, eq. (5) of the method: one column for each location, or for each
// (location, view). The location is the one that scores highest, the view its best column's.
class LinearPredictor : public Predictor {
 public:
  struct Column {
    int location = 0;
    int view = -1;  // -1: of all views
    double bias = 0;
    Eigen::VectorXd weights;  // [words]
  };

  // `num_locations`: of the labels; a location without a column is never answered.
  LinearPredictor(const std::vector<Column>& columns, int num_words, int num_locations,
                  ColumnRule rule = ColumnRule::kBest);

  Answer Predict(const Histogram& histogram) const override;
  double MultiplyAdds(const Histogram& histogram) const override;

  // f of eq. (5), [columns] in the order given.
  std::vector<float> Scores(const Histogram& histogram) const;
  std::span<const int> column_location() const { return location_; }
  std::span<const int> column_view() const { return view_; }

 private:
  std::vector<int> location_;   // [columns]
  std::vector<int> view_;       // [columns]
  std::vector<float> bias_;     // [columns]
  std::vector<float> weights_;  // [words, columns]: a word's weights lie side by side
  int num_locations_;
  ColumnRule rule_;
};

// sum_i coefficient_i h(x_i), the weights of a sum over samples.
//   terms   (sample, coefficient)
Eigen::VectorXd SumOfSamples(std::span<const Histogram> histograms,
                             std::span<const std::pair<int, double>> terms, int num_words);

}  // namespace viewfix
