// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "firmware_tools/experiment/linear_predictor.h"
#include "firmware_tools/experiment/method.h"

namespace viewfix {

// Costs C that all SVMs choose from, those of `viewfix train`.
std::vector<double> SvmCosts();

// Ours: eq. (2) of the method, one model for each location, its views the tasks.
class MultitaskSvm : public Method {
 public:
  std::string name() const override { return "multitask_svm"; }
  bool tells_views() const override { return true; }
  std::vector<Parameter> parameters() const override;  // C, negatives, beta, rule
  std::unique_ptr<Predictor> Train(const TrainingData& data,
                                   std::span<const double> values) const override;
};

// Eq. (2) as beta -> infinity: the views of a location share one vector and keep a bias each,
// which is all that is left to tell them apart. The best view's score counts.
class PooledSvm : public Method {
 public:
  std::string name() const override { return "svm_pooled"; }
  bool tells_views() const override { return true; }
  std::vector<Parameter> parameters() const override;  // C, negatives
  std::unique_ptr<Predictor> Train(const TrainingData& data,
                                   std::span<const double> values) const override;
};

// Eq. (2) as beta -> 0: an SVM of its own (libsvm) for each location and view; the best view's
// score counts.
class IndependentSvm : public Method {
 public:
  std::string name() const override { return "svm_independent"; }
  bool tells_views() const override { return true; }
  std::vector<Parameter> parameters() const override;  // C, negatives
  std::unique_ptr<Predictor> Train(const TrainingData& data,
                                   std::span<const double> values) const override;
};

// The paper's rival: for each location an SVM (libsvm) trained on the images of one view alone.
class SingleViewSvm : public Method {
 public:
  explicit SingleViewSvm(std::string view) : view_(std::move(view)) {}
  const std::string& view() const { return view_; }
  std::string name() const override { return "svm_view_" + view_; }
  bool tells_views() const override { return false; }
  std::vector<Parameter> parameters() const override;  // C
  std::unique_ptr<Predictor> Train(const TrainingData& data,
                                   std::span<const double> values) const override;

 private:
  std::string view_;
};

// For each location an SVM (libsvm) of its images of all views against all others.
class OneVsRestSvm : public Method {
 public:
  std::string name() const override { return "svm_one_vs_rest"; }
  bool tells_views() const override { return false; }
  std::vector<Parameter> parameters() const override;  // C
  std::unique_ptr<Predictor> Train(const TrainingData& data,
                                   std::span<const double> values) const override;
};

}  // namespace viewfix
