// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/multitask_svm.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "tests/firmware_tools/training/multitask_problem.h"

namespace viewfix {
namespace {

using testing::Decisions;
using testing::GaussianGram;
using testing::Gram;
using testing::MakeProblem;
using testing::MultitaskProblem;

MultitaskSvmOptions Options(double beta, double relative_gap = 1e-6) {
  MultitaskSvmOptions options;
  options.beta = beta;
  options.relative_gap = relative_gap;
  return options;
}

struct Objectives {
  double primal = 0;
  double dual = 0;
};

// Eq. (2) and (3) from their definitions, at the solution's a and biases.
Objectives Evaluate(const std::vector<DualVariable>& variables,
                    const MultitaskSvmSolution& solution, const std::vector<double>& decisions) {
  double norm2 = 0;
  double loss = 0;
  double sum_alpha = 0;
  for (std::size_t i = 0; i < variables.size(); ++i) {
    const DualVariable& v = variables[i];
    norm2 += solution.alpha[i] * v.label * (decisions[i] - solution.bias[v.task]);
    loss += v.cost * std::max(0.0, 1 - v.label * decisions[i]);
    sum_alpha += solution.alpha[i];
  }
  return {norm2 / 2 + loss, sum_alpha - norm2 / 2};
}

void ExpectFeasible(const std::vector<DualVariable>& variables, int num_tasks,
                    const MultitaskSvmSolution& solution) {
  ASSERT_EQ(solution.alpha.size(), variables.size());
  ASSERT_EQ(solution.bias.size(), static_cast<std::size_t>(num_tasks));
  std::vector<double> balance(num_tasks, 0.0);
  std::vector<double> total(num_tasks, 0.0);
  for (std::size_t i = 0; i < variables.size(); ++i) {
    EXPECT_GE(solution.alpha[i], 0);
    EXPECT_LE(solution.alpha[i], variables[i].cost);
    balance[variables[i].task] += solution.alpha[i] * variables[i].label;
    total[variables[i].task] += solution.alpha[i];
  }
  for (int t = 0; t < num_tasks; ++t) EXPECT_NEAR(balance[t], 0, 1e-12 * total[t]);
}

// Feasible, and every margin on the side its multiplier says: sufficient for the optimum.
// The gap leaves multipliers a little beside their bounds.
void ExpectOptimal(const std::vector<DualVariable>& variables, int num_tasks,
                   const MultitaskSvmSolution& solution, const std::vector<double>& decisions,
                   double tolerance) {
  ExpectFeasible(variables, num_tasks, solution);
  for (std::size_t i = 0; i < variables.size(); ++i) {
    const double margin = variables[i].label * decisions[i];
    const double share = solution.alpha[i] / variables[i].cost;
    if (share < 1 - 1e-6) {
      EXPECT_GE(margin, 1 - tolerance) << i;
    }
    if (share > 1e-6) {
      EXPECT_LE(margin, 1 + tolerance) << i;
    }
  }
}

MultitaskSvmSolution Solve(const MultitaskProblem& problem, const Eigen::MatrixXf& kernel,
                           const MultitaskSvmOptions& options) {
  return SolveMultitaskSvm(kernel, kernel, problem.variables, problem.num_tasks, options);
}

struct Setting {
  int num_tasks;
  double cost;
  double beta;
};

class MultitaskSvmSettings : public ::testing::TestWithParam<Setting> {};

TEST_P(MultitaskSvmSettings, GapClosesAndKktHold) {
  const auto [num_tasks, cost, beta] = GetParam();
  const MultitaskProblem problem = MakeProblem(150, 6, num_tasks, cost, 7);
  const Eigen::MatrixXf kernel = Gram(problem.features);
  const auto solution = Solve(problem, kernel, Options(beta));
  EXPECT_TRUE(solution.converged);
  const auto decisions = Decisions(kernel, kernel, problem.variables, beta, solution);
  const Objectives objectives = Evaluate(problem.variables, solution, decisions);
  EXPECT_NEAR(solution.primal, objectives.primal, 1e-9 * objectives.primal);
  EXPECT_NEAR(solution.dual, objectives.dual, 1e-9 * objectives.dual);
  EXPECT_GE(solution.primal, solution.dual * (1 - 1e-12));
  EXPECT_LE(solution.primal - solution.dual, 1e-6 * solution.dual);
  const auto tight = Solve(problem, kernel, Options(beta, 1e-11));
  ExpectOptimal(problem.variables, num_tasks, tight,
                Decisions(kernel, kernel, problem.variables, beta, tight), 1e-4);
}

TEST_P(MultitaskSvmSettings, DifferentSpacesReachTheirOptimum) {
  const auto [num_tasks, cost, beta] = GetParam();
  const MultitaskProblem problem = MakeProblem(90, 6, num_tasks, cost, 8);
  const Eigen::MatrixXf decision = Gram(problem.features);
  const Eigen::MatrixXf correcting = GaussianGram(problem.features, 0.5F);
  const auto solution =
      SolveMultitaskSvm(decision, correcting, problem.variables, num_tasks, Options(beta, 1e-11));
  const auto decisions = Decisions(decision, correcting, problem.variables, beta, solution);
  const Objectives objectives = Evaluate(problem.variables, solution, decisions);
  EXPECT_LE(objectives.primal - objectives.dual, 1e-9 * objectives.dual);
  ExpectOptimal(problem.variables, num_tasks, solution, decisions, 1e-4);
}

INSTANTIATE_TEST_SUITE_P(All, MultitaskSvmSettings,
                         ::testing::Values(Setting{1, 1, 1}, Setting{2, 10, 0.1},
                                           Setting{3, 0.01, 1}, Setting{3, 1, 20},
                                           Setting{4, 1, 0.01}, Setting{4, 100, 2}));

TEST(MultitaskSvm, TwoPointsHaveTheKnownSolution) {
  Eigen::MatrixXf kernel(2, 2);
  kernel << 1, -1, -1, 1;  // h = +1, -1
  const std::vector<DualVariable> variables = {{0, 0, 1, 100}, {1, 0, -1, 100}};
  for (const double beta : {0.25, 1.0, 8.0}) {
    const auto solution = SolveMultitaskSvm(kernel, kernel, variables, 1, Options(beta));
    // max 2a - 1/2 (2a)^2 (1 + 1/beta)
    EXPECT_NEAR(solution.alpha[0], 0.5 / (1 + 1 / beta), 1e-9);
    EXPECT_NEAR(solution.alpha[1], solution.alpha[0], 1e-12);
    EXPECT_NEAR(solution.bias[0], 0, 1e-6);
  }
}

TEST(MultitaskSvm, EqualSamplesOfBothLabelsCostTheirMinimum) {
  const Eigen::MatrixXf kernel = Eigen::MatrixXf::Ones(5, 5);
  const std::vector<DualVariable> variables = {
      {0, 0, 1, 2}, {1, 0, 1, 2}, {2, 0, -1, 1}, {3, 0, -1, 1}, {4, 0, -1, 1}};
  const auto solution = SolveMultitaskSvm(kernel, kernel, variables, 1, Options(1));
  // No direction separates them: the bias +1 makes every negative pay 2.
  EXPECT_TRUE(solution.converged);
  EXPECT_NEAR(solution.primal, 6, 1e-9);
  EXPECT_NEAR(solution.dual, 6, 1e-9);
  EXPECT_NEAR(solution.bias[0], 1, 1e-9);
}

TEST(MultitaskSvm, LargeBetaPoolsTheTasks) {
  const MultitaskProblem problem = MakeProblem(60, 5, 3, 1, 9);
  const Eigen::MatrixXf kernel = Gram(problem.features);
  const auto solution = Solve(problem, kernel, Options(1e6, 1e-10));
  ASSERT_TRUE(solution.converged);
  // Optimal for the problem without correcting spaces: one direction, a bias per task.
  const Eigen::MatrixXf none = Eigen::MatrixXf::Zero(kernel.rows(), kernel.cols());
  const auto decisions = Decisions(kernel, none, problem.variables, 1, solution);
  ExpectOptimal(problem.variables, 3, solution, decisions, 1e-3);
  const Objectives pooled = Evaluate(problem.variables, solution, decisions);
  EXPECT_LE(pooled.primal - pooled.dual, 1e-4 * pooled.dual);
}

TEST(MultitaskSvm, SmallBetaSplitsTheTasks) {
  const double c = 2;
  const double beta = 1e-6;
  const MultitaskProblem problem = MakeProblem(60, 5, 3, c * beta, 10);
  const Eigen::MatrixXf kernel = Gram(problem.features);
  const auto solution = Solve(problem, kernel, Options(beta, 1e-10));
  ASSERT_TRUE(solution.converged);
  // a / beta is optimal for each task on its own, with the parameter c.
  for (int t = 0; t < problem.num_tasks; ++t) {
    std::vector<DualVariable> variables;
    MultitaskSvmSolution alone;
    for (std::size_t i = 0; i < problem.variables.size(); ++i) {
      if (problem.variables[i].task != t) continue;
      variables.push_back(problem.variables[i]);
      variables.back().task = 0;
      variables.back().cost /= beta;
      alone.alpha.push_back(std::min(solution.alpha[i] / beta, variables.back().cost));
    }
    alone.bias = {solution.bias[t]};
    const Eigen::MatrixXf none = Eigen::MatrixXf::Zero(kernel.rows(), kernel.cols());
    const auto decisions = Decisions(kernel, none, variables, 1, alone);
    ExpectOptimal(variables, 1, alone, decisions, 1e-3);
    const Objectives objectives = Evaluate(variables, alone, decisions);
    EXPECT_LE(objectives.primal - objectives.dual, 1e-4 * objectives.dual);
  }
}

TEST(MultitaskSvm, OrderOfVariablesAndSamplesDoesNotMatter) {
  const MultitaskProblem problem = MakeProblem(90, 6, 3, 1, 11);
  const int n = static_cast<int>(problem.features.rows());
  std::vector<int> place(n);
  for (int i = 0; i < n; ++i) place[i] = (i * 37 + 5) % n;
  MultitaskProblem shuffled = problem;
  for (int i = 0; i < n; ++i) shuffled.features.row(place[i]) = problem.features.row(i);
  for (DualVariable& v : shuffled.variables) v.sample_idx = place[v.sample_idx];
  std::reverse(shuffled.variables.begin(), shuffled.variables.end());
  const Eigen::MatrixXf kernel = Gram(problem.features);
  const Eigen::MatrixXf shuffled_kernel = Gram(shuffled.features);
  const auto a = Solve(problem, kernel, Options(1, 1e-11));
  const auto b = Solve(shuffled, shuffled_kernel, Options(1, 1e-11));
  auto decisions = Decisions(kernel, kernel, problem.variables, 1, a);
  const auto other = Decisions(shuffled_kernel, shuffled_kernel, shuffled.variables, 1, b);
  std::reverse(decisions.begin(), decisions.end());
  for (std::size_t i = 0; i < other.size(); ++i) EXPECT_NEAR(decisions[i], other[i], 1e-4);
  for (int t = 0; t < 3; ++t) EXPECT_NEAR(a.bias[t], b.bias[t], 1e-4);
}

TEST(MultitaskSvm, RunsAreEqual) {
  const MultitaskProblem problem = MakeProblem(120, 6, 3, 1, 12);
  const Eigen::MatrixXf kernel = Gram(problem.features);
  const auto a = Solve(problem, kernel, Options(1));
  const auto b = Solve(problem, kernel, Options(1));
  EXPECT_EQ(a.alpha, b.alpha);
  EXPECT_EQ(a.bias, b.bias);
  EXPECT_EQ(a.iterations, b.iterations);
}

TEST(MultitaskSvm, TasksWithoutOneLabelAreAbsent) {
  const MultitaskProblem problem = MakeProblem(60, 5, 2, 1, 13);
  const Eigen::MatrixXf kernel = Gram(problem.features);
  const auto alone = Solve(problem, kernel, Options(1));
  // Tasks 2 and 3 have one label each, task 4 nothing.
  MultitaskProblem more = problem;
  more.num_tasks = 5;
  for (int i = 0; i < 20; ++i) more.variables.push_back({i, 2 + i % 2, i % 2 == 0 ? 1 : -1, 1});
  const auto solution = Solve(more, kernel, Options(1));
  for (std::size_t i = 0; i < more.variables.size(); ++i) {
    if (i < alone.alpha.size()) {
      EXPECT_EQ(solution.alpha[i], alone.alpha[i]);
    } else {
      EXPECT_EQ(solution.alpha[i], 0);
    }
  }
  for (int t = 0; t < 2; ++t) EXPECT_EQ(solution.bias[t], alone.bias[t]);
  for (int t = 2; t < 5; ++t) EXPECT_TRUE(std::isnan(solution.bias[t]));
  EXPECT_EQ(solution.primal, alone.primal);
}

TEST(MultitaskSvm, NothingToSolveIsSolved) {
  const Eigen::MatrixXf kernel = Eigen::MatrixXf::Identity(2, 2);
  const auto solution = SolveMultitaskSvm(kernel, kernel, {}, 2, Options(1));
  EXPECT_TRUE(solution.converged);
  EXPECT_TRUE(std::isnan(solution.bias[0]) && std::isnan(solution.bias[1]));
  EXPECT_TRUE(SolveMultitaskSvm(Eigen::MatrixXf(), Eigen::MatrixXf(), {}, 0, Options(1)).converged);
}

TEST(MultitaskSvm, CostsBindOneByOne) {
  const MultitaskProblem clean = MakeProblem(90, 5, 2, 1, 14);
  const Eigen::MatrixXf kernel = Gram(clean.features);
  MultitaskProblem noisy = clean;
  for (int i = 0; i < 30; ++i) {
    const DualVariable& v = clean.variables[i];
    noisy.variables.push_back({v.sample_idx, v.task, -v.label, 1e-9});  // wrong, but cheap
  }
  const auto a = Solve(clean, kernel, Options(1, 1e-11));
  const auto b = Solve(noisy, kernel, Options(1, 1e-11));
  ExpectFeasible(noisy.variables, 2, b);
  for (std::size_t i = 0; i < a.alpha.size(); ++i) EXPECT_NEAR(a.alpha[i], b.alpha[i], 1e-5);
  for (auto& v : noisy.variables) v.cost = 1;
  EXPECT_GT(Solve(noisy, kernel, Options(1)).dual, 1.1 * b.dual);
}

TEST(MultitaskSvm, StopsAtTheIterationLimitWithAFeasiblePoint) {
  const MultitaskProblem problem = MakeProblem(150, 6, 3, 1, 15);
  const Eigen::MatrixXf kernel = Gram(problem.features);
  MultitaskSvmOptions options = Options(1);
  for (const int limit : {0, 1, 10}) {
    options.max_iterations = limit;
    const auto solution = Solve(problem, kernel, options);
    EXPECT_FALSE(solution.converged);
    EXPECT_EQ(solution.iterations, limit);
    EXPECT_GT(solution.primal, solution.dual);
    ExpectFeasible(problem.variables, problem.num_tasks, solution);
  }
}

TEST(MultitaskSvm, AnImpossibleGapEnds) {
  const MultitaskProblem problem = MakeProblem(60, 5, 2, 1, 16);
  const Eigen::MatrixXf kernel = Gram(problem.features);
  const auto solution = Solve(problem, kernel, Options(1, 0));
  EXPECT_LE(solution.primal - solution.dual, 1e-9 * solution.dual);
  EXPECT_LT(solution.iterations, 1'000'000);
}

TEST(MultitaskSvm, KernelsThatAreNoneEndFeasible) {
  MultitaskProblem problem = MakeProblem(30, 5, 2, 1, 17);
  std::mt19937_64 random(18);
  for (const float scale : {1.0F, 1e30F, 3e38F, 1e-38F}) {
    Eigen::MatrixXf kernel(30, 30);
    for (int i = 0; i < 30; ++i) {
      for (int j = 0; j <= i; ++j) {
        kernel(i, j) = scale * static_cast<float>(testing::Symmetric(random));
        kernel(j, i) = kernel(i, j);
      }
    }
    for (const double beta : {1e-100, 1.0, 1e100}) {
      MultitaskSvmOptions options = Options(beta);
      options.max_iterations = 1000;
      ExpectFeasible(problem.variables, 2, Solve(problem, kernel, options));
    }
  }
}

TEST(MultitaskSvm, RefusesWhatMakesNoSense) {
  const MultitaskProblem problem = MakeProblem(12, 3, 2, 1, 19);
  const Eigen::MatrixXf kernel = Gram(problem.features);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const auto solve_with = [&](DualVariable variable) {
    MultitaskProblem broken = problem;
    broken.variables.push_back(variable);
    return Solve(broken, kernel, Options(1));
  };
  EXPECT_NO_THROW(solve_with({0, 0, 1, 1}));
  for (const DualVariable& variable : std::vector<DualVariable>{{-1, 0, 1, 1},
                                                                {12, 0, 1, 1},
                                                                {0, -1, 1, 1},
                                                                {0, 2, 1, 1},
                                                                {0, 0, 0, 1},
                                                                {0, 0, 2, 1},
                                                                {0, 0, 1, 0},
                                                                {0, 0, 1, -1},
                                                                {0, 0, 1, nan},
                                                                {0, 0, 1, infinity}}) {
    EXPECT_THROW(solve_with(variable), std::invalid_argument);
  }
  for (const double beta : {0.0, -1.0, nan, infinity, 5e-324}) {
    EXPECT_THROW(Solve(problem, kernel, Options(beta)), std::invalid_argument);
  }
  EXPECT_THROW(SolveMultitaskSvm(kernel, kernel, {}, -1, Options(1)), std::invalid_argument);
}

TEST(MultitaskSvm, RefusesBrokenKernels) {
  const MultitaskProblem problem = MakeProblem(12, 3, 2, 1, 20);
  const Eigen::MatrixXf kernel = Gram(problem.features);
  const auto solve = [&](const Eigen::MatrixXf& decision, const Eigen::MatrixXf& correcting) {
    return SolveMultitaskSvm(decision, correcting, problem.variables, 2, Options(1));
  };
  EXPECT_NO_THROW(solve(kernel, kernel));
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    Eigen::MatrixXf broken = kernel;
    broken(7, 3) = bad;
    EXPECT_THROW(solve(broken, kernel), std::invalid_argument);
    EXPECT_THROW(solve(kernel, broken), std::invalid_argument);
  }
  EXPECT_THROW(solve(kernel.leftCols(11), kernel), std::invalid_argument);
  EXPECT_THROW(solve(kernel, kernel.topLeftCorner(11, 11)), std::invalid_argument);
  EXPECT_THROW(solve(Eigen::MatrixXf(), Eigen::MatrixXf()), std::invalid_argument);
}

}  // namespace
}  // namespace viewfix
