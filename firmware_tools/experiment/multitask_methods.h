// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "firmware_tools/experiment/linear_predictor.h"
#include "firmware_tools/experiment/method.h"
#include "firmware_tools/experiment/multitask_learning.h"

namespace viewfix {

// A multi-task rival of the paper: as ours, one model for each location, its views the tasks,
// with the same positives and negatives; only loss and regularizer differ.
class MultitaskRival : public Method {
 public:
  bool tells_views() const override { return true; }
  // Negatives and rule as MultitaskSvm has them, after the rival's own.
  std::vector<Parameter> parameters() const override;
  std::unique_ptr<Predictor> Train(const TrainingData& data,
                                   std::span<const double> values) const override;

 protected:
  virtual std::vector<Parameter> OwnParameters() const = 0;
  //   values   of OwnParameters()
  virtual MultitaskWeights Solve(const LearningTasks& tasks,
                                 std::span<const double> values) const = 0;
};

class SparseTrace : public MultitaskRival {
 public:
  std::string name() const override { return "mtl_sparse_trace"; }

 protected:
  std::vector<Parameter> OwnParameters() const override;  // gamma, tau
  MultitaskWeights Solve(const LearningTasks& tasks, std::span<const double> values) const override;
};

class ClusteredLearning : public MultitaskRival {
 public:
  std::string name() const override { return "mtl_cmtl"; }

 protected:
  std::vector<Parameter> OwnParameters() const override;  // rho, eta, k
  MultitaskWeights Solve(const LearningTasks& tasks, std::span<const double> values) const override;
};

class StructureLearning : public MultitaskRival {
 public:
  std::string name() const override { return "mtl_caso"; }
  std::string chooses_as() const override { return ClusteredLearning().name(); }

 protected:
  std::vector<Parameter> OwnParameters() const override;  // rho, eta, h
  MultitaskWeights Solve(const LearningTasks& tasks, std::span<const double> values) const override;
};

}  // namespace viewfix
