// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>
#include <svm.h>

#include <memory>

#include "firmware_tools/training/multitask_svm.h"
#include "tests/firmware_tools/training/multitask_problem.h"

namespace viewfix {
namespace {

using testing::Decisions;
using testing::GaussianGram;
using testing::Gram;
using testing::MakeProblem;
using testing::MultitaskProblem;

void BeSilent(const char*) {}

struct FreeModel {
  void operator()(svm_model* model) const { svm_free_and_destroy_model(&model); }
};

// Decision values of libsvm's C-SVC at its own training samples, the variables of `task`, with
// the kernel `scale` * kernel and costs `cost_scale` * cost (one for each label).
std::vector<double> LibsvmDecisions(const Eigen::MatrixXf& kernel,
                                    const std::vector<DualVariable>& all, int task, double scale,
                                    double cost_scale) {
  std::vector<DualVariable> variables;
  for (const DualVariable& v : all) {
    if (v.task == task) variables.push_back(v);
  }
  const int n = static_cast<int>(variables.size());
  std::vector<std::vector<svm_node>> rows(n);
  std::vector<svm_node*> row_starts(n);
  std::vector<double> labels(n);
  double cost[2] = {0, 0};
  for (int i = 0; i < n; ++i) {
    rows[i].push_back({0, i + 1.0});  // libsvm's form of a precomputed kernel
    for (int j = 0; j < n; ++j) {
      const double value = kernel(variables[i].sample_idx, variables[j].sample_idx);
      rows[i].push_back({j + 1, scale * value});
    }
    rows[i].push_back({-1, 0});
    row_starts[i] = rows[i].data();
    labels[i] = variables[i].label;
    cost[variables[i].label > 0] = cost_scale * variables[i].cost;
  }
  int weight_label[2] = {-1, 1};
  svm_parameter parameter = {};
  parameter.svm_type = C_SVC;
  parameter.kernel_type = PRECOMPUTED;
  parameter.cache_size = 10;
  parameter.eps = 1e-8;
  parameter.C = 1;
  parameter.nr_weight = 2;
  parameter.weight_label = weight_label;
  parameter.weight = cost;
  const svm_problem problem = {n, labels.data(), row_starts.data()};
  svm_set_print_string_function(BeSilent);
  const std::unique_ptr<svm_model, FreeModel> model(svm_train(&problem, &parameter));
  const int sign = model->label[0];
  std::vector<double> decisions(n);
  for (int i = 0; i < n; ++i) {
    svm_predict_values(model.get(), row_starts[i], &decisions[i]);
    decisions[i] *= sign;
  }
  return decisions;
}

// Ours at the variables of one task.
std::vector<double> TaskDecisions(const Eigen::MatrixXf& kernel, const MultitaskProblem& problem,
                                  double beta, const MultitaskSvmSolution& solution, int task) {
  const auto all = Decisions(kernel, kernel, problem.variables, beta, solution);
  std::vector<double> decisions;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (problem.variables[i].task == task) decisions.push_back(all[i]);
  }
  return decisions;
}

MultitaskSvmSolution Solve(const MultitaskProblem& problem, const Eigen::MatrixXf& kernel,
                           double beta) {
  MultitaskSvmOptions options;
  options.beta = beta;
  options.relative_gap = 1e-13;  // half of |dw|^2 is within the gap
  return SolveMultitaskSvm(kernel, kernel, problem.variables, problem.num_tasks, options);
}

void ExpectNear(const std::vector<double>& ours, const std::vector<double>& theirs,
                double tolerance) {
  ASSERT_EQ(ours.size(), theirs.size());
  for (std::size_t i = 0; i < ours.size(); ++i) EXPECT_NEAR(ours[i], theirs[i], tolerance) << i;
}

// w and w_1 share what one vector would do alone: the kernel counts 1 + 1 / beta times.
TEST(MultitaskSvmAgainstLibsvm, OneTaskIsAnSvm) {
  // 1 + 1 / beta is a power of two: libsvm rounds its kernel to float.
  for (const double beta : {1.0 / 7, 1.0 / 3, 1.0, 1e30}) {
    for (const double cost : {0.01, 1.0, 100.0}) {
      MultitaskProblem problem = MakeProblem(150, 6, 1, cost, 31);
      for (DualVariable& v : problem.variables) v.cost *= v.label > 0 ? 1 : 0.3;
      for (const Eigen::MatrixXf& kernel :
           {Gram(problem.features), GaussianGram(problem.features, 0.5F)}) {
        ExpectNear(TaskDecisions(kernel, problem, beta, Solve(problem, kernel, beta), 0),
                   LibsvmDecisions(kernel, problem.variables, 0, 1 + 1 / beta, 1), 1e-4);
      }
    }
  }
}

TEST(MultitaskSvmAgainstLibsvm, SmallBetaGivesIndependentSvms) {
  const double c = 2;
  const double beta = 1e-7;
  const MultitaskProblem problem = MakeProblem(120, 6, 3, c * beta, 32);
  const Eigen::MatrixXf kernel = Gram(problem.features);
  const auto solution = Solve(problem, kernel, beta);
  for (int t = 0; t < 3; ++t) {
    ExpectNear(TaskDecisions(kernel, problem, beta, solution, t),
               LibsvmDecisions(kernel, problem.variables, t, 1, 1 / beta), 1e-4);
  }
}

}  // namespace
}  // namespace viewfix
