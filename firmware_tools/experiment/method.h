// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "engine/vocabulary/vocabulary.h"
#include "firmware_tools/training/labels.h"

namespace viewfix {

// What every method of the experiment is trained on: the same histograms, labels and samples.
struct TrainingData {
  const Labels& labels;
  std::span<const Histogram> histograms;  // [samples]
  const Eigen::MatrixXf& gram;            // [samples, samples] their dot products
  int num_words = 0;
  std::vector<bool> used;  // [samples]; the others are held out

  std::vector<int> UsedSamples() const {
    std::vector<int> samples;
    for (int s = 0; s < static_cast<int>(used.size()); ++s) {
      if (used[s]) samples.push_back(s);
    }
    return samples;
  }
};

// What a method takes an image for.
struct Answer {
  int location = -1;  // into Labels::locations
  int view = -1;      // into Labels::views; -1: the method tells no views
};

// A trained method. Thread-safe.
class Predictor {
 public:
  virtual ~Predictor() = default;
  virtual Answer Predict(const Histogram& histogram) const = 0;
  // Multiplications and additions of one prediction, counted as pairs.
  virtual double MultiplyAdds(const Histogram& histogram) const = 0;
};

// A parameter that is chosen on held-out blocks.
struct Parameter {
  std::string name;
  std::vector<double> values;
  double start = 0;  // one of `values`: taken until the parameter's turn comes
};

// One way to tell locations, and views or not. Training is deterministic and thread-safe.
class Method {
 public:
  virtual ~Method() = default;
  virtual std::string name() const = 0;
  virtual bool tells_views() const = 0;
  // Chosen one after another, in this order.
  virtual std::vector<Parameter> parameters() const = 0;
  // An earlier method that minimizes the same function of the same parameters, so that its choice
  // is this one's too; empty: none.
  virtual std::string chooses_as() const { return {}; }
  //   values   one for each of parameters(), same order
  virtual std::unique_ptr<Predictor> Train(const TrainingData& data,
                                           std::span<const double> values) const = 0;
};

}  // namespace viewfix
