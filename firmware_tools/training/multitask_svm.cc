// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/multitask_svm.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

namespace viewfix {
namespace {

using KernelRef = Eigen::Ref<const Eigen::MatrixXf>;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
// Curvature below this counts as this: duplicates make it zero.
constexpr double kMinCurvature = 1e-12;
// A violation this small against margins of 1 is rounding: steps no longer help.
constexpr double kViolationFloor = 1e-14;
// Variables at a bound that one pass takes up, for each task and each direction. More make
// steps slower, fewer make more passes; 64 to 256 cost the same.
constexpr std::size_t kMaxAtBound = 128;
// Steps stay in the worst task until its violation has fallen by this factor.
constexpr double kStayReduction = 0.5;
// A pass ends when its violation has fallen by this factor.
constexpr double kPassReduction = 0.1;
// So many passes in a row that gain nothing end it: rounding has the upper hand.
constexpr int kMaxIdlePasses = 10;
// Costs, beta and 1 / beta up to here leave products with any float finite.
constexpr double kLargest = 1e100;

void Require(bool condition, const char* message) {
  if (!condition) throw std::invalid_argument(std::string("multi-task SVM: ") + message);
}

void CheckKernel(const KernelRef& kernel) {
  Require(kernel.rows() == kernel.cols(), "a kernel is not square");
  for (Eigen::Index col = 0; col < kernel.cols(); ++col) {
    // The sum of x - x is 0 unless some x is not finite.
    const float* x = kernel.col(col).data();
    bool finite = true;
    for (Eigen::Index i = 0; i < kernel.rows(); ++i) finite &= x[i] - x[i] == 0.0f;
    Require(finite, "a kernel is not finite");
  }
}

void CheckVariables(std::span<const DualVariable> variables, int num_tasks, Eigen::Index n) {
  Require(num_tasks >= 0, "the number of tasks is negative");
  for (const DualVariable& variable : variables) {
    Require(variable.sample_idx >= 0 && variable.sample_idx < n, "a sample is out of range");
    Require(variable.task >= 0 && variable.task < num_tasks, "a task is out of range");
    Require(variable.label == 1 || variable.label == -1, "a label is not +1 or -1");
    Require(variable.cost > 0 && variable.cost <= kLargest, "a cost is not within (0, 1e100]");
  }
}

void CheckBeta(double beta) {
  Require(beta >= 1 / kLargest && beta <= kLargest, "beta is not within [1e-100, 1e100]");
}

bool IsSame(const KernelRef& a, const KernelRef& b) {
  return a.data() == b.data() && a.outerStride() == b.outerStride();
}

// y += factor * x
void AddScaled(double factor, const float* x, std::vector<double>& y) {
  for (std::size_t i = 0; i < y.size(); ++i) y[i] += factor * static_cast<double>(x[i]);
}

// A square block of a kernel, rows contiguous, so that steps read memory in order.
class KernelBlock {
 public:
  KernelBlock(const KernelRef& kernel, const std::vector<int>& samples) : size_(samples.size()) {
    values_.resize(size_ * size_);
    for (std::size_t row = 0; row < size_; ++row) {
      const float* column = kernel.col(samples[row]).data();
      for (std::size_t i = 0; i < size_; ++i) values_[row * size_ + i] = column[samples[i]];
    }
  }
  const float* Row(int row) const { return values_.data() + row * size_; }

 private:
  std::size_t size_;
  std::vector<float> values_;
};

// y += factor * (a - b)
void AddDifference(double factor, const float* a, const float* b, std::vector<double>& y) {
  for (std::size_t i = 0; i < y.size(); ++i) {
    y[i] += factor * (static_cast<double>(a[i]) - static_cast<double>(b[i]));
  }
}

// The variables of one task that a pass may move. `coefficient` is a_i y_i: a step raises one
// and lowers another by the same amount, whatever the labels, which keeps sum a_i y_i.
struct ActiveTask {
  std::vector<int> variable;        // index among all variables
  std::vector<int> row;             // of the kernel blocks
  std::vector<double> label;        // y
  std::vector<double> coefficient;  // between lower and upper
  std::vector<double> lower;
  std::vector<double> upper;
  std::vector<double> correcting_score;  // [rows] w_t'phi_t(x)
};

struct Violation {
  double amount = 0;  // 0: none
  int raised = -1;    // the coefficient that wants most to rise
};

// Minimizes the negative dual over a few variables of each task, the others fixed.
class Pass {
 public:
  // No `correcting` block: the spaces agree.
  Pass(KernelBlock decision, std::optional<KernelBlock> correcting, double beta,
       std::vector<double> decision_score, std::vector<ActiveTask> tasks)
      : decision_(std::move(decision)),
        correcting_(std::move(correcting)),
        inverse_beta_(1 / beta),
        decision_score_(std::move(decision_score)),
        tasks_(std::move(tasks)) {}

  // Steps until no task violates by more than `tolerance`; returns the number of steps.
  std::int64_t Run(double tolerance, std::int64_t max_steps);

  const std::vector<ActiveTask>& tasks() const { return tasks_; }

 private:
  const KernelBlock& Correcting() const { return correcting_ ? *correcting_ : decision_; }
  // y_i - f(x_i): the bias that would put x_i on its margin.
  double MarginBias(const ActiveTask& task, int i) const {
    const int row = task.row[i];
    return task.label[i] - (decision_score_[row] + task.correcting_score[row]);
  }
  Violation FindViolation(const ActiveTask& task) const;
  int ChooseLowered(const ActiveTask& task, int raised) const;
  // Second derivative along raising one coefficient and lowering another of one task.
  double Curvature(int raised_row, int lowered_row) const;
  void Step(ActiveTask& task, int raised, int lowered);

  KernelBlock decision_;
  std::optional<KernelBlock> correcting_;
  double inverse_beta_;
  std::vector<double> decision_score_;  // [rows] w'phi(x)
  std::vector<ActiveTask> tasks_;
};

Violation Pass::FindViolation(const ActiveTask& task) const {
  double highest = -kInfinity;
  double lowest = kInfinity;
  Violation violation;
  for (int i = 0; i < static_cast<int>(task.row.size()); ++i) {
    const double margin_bias = MarginBias(task, i);
    if (margin_bias > highest && task.coefficient[i] < task.upper[i]) {
      highest = margin_bias;
      violation.raised = i;
    }
    if (margin_bias < lowest && task.coefficient[i] > task.lower[i]) lowest = margin_bias;
  }
  violation.amount = std::max(0.0, highest - lowest);
  return violation;
}

double Pass::Curvature(int raised_row, int lowered_row) const {
  const auto distance2 = [=](const KernelBlock& block) {
    const double raised = block.Row(raised_row)[raised_row];
    const double lowered = block.Row(lowered_row)[lowered_row];
    return raised + lowered - 2.0 * block.Row(raised_row)[lowered_row];
  };
  const double curvature = distance2(decision_) + inverse_beta_ * distance2(Correcting());
  return std::max(curvature, kMinCurvature);
}

int Pass::ChooseLowered(const ActiveTask& task, int raised) const {
  const double highest = MarginBias(task, raised);
  double best_gain = -1;
  int lowered = -1;
  for (int j = 0; j < static_cast<int>(task.row.size()); ++j) {
    if (task.coefficient[j] <= task.lower[j]) continue;
    const double slope = highest - MarginBias(task, j);
    if (slope <= 0) continue;
    const double gain = slope * slope / Curvature(task.row[raised], task.row[j]);
    if (gain > best_gain) {
      best_gain = gain;
      lowered = j;
    }
  }
  return lowered;
}

void Pass::Step(ActiveTask& task, int raised, int lowered) {
  const int raised_row = task.row[raised];
  const int lowered_row = task.row[lowered];
  const double slope = MarginBias(task, raised) - MarginBias(task, lowered);
  const double raised_room = task.upper[raised] - task.coefficient[raised];
  const double lowered_room = task.coefficient[lowered] - task.lower[lowered];
  const double step =
      std::min({slope / Curvature(raised_row, lowered_row), raised_room, lowered_room});
  // Bounds are met exactly, so that "at the bound" is a plain comparison.
  task.coefficient[raised] =
      step == raised_room ? task.upper[raised] : task.coefficient[raised] + step;
  task.coefficient[lowered] =
      step == lowered_room ? task.lower[lowered] : task.coefficient[lowered] - step;
  AddDifference(step, decision_.Row(raised_row), decision_.Row(lowered_row), decision_score_);
  AddDifference(step * inverse_beta_, Correcting().Row(raised_row), Correcting().Row(lowered_row),
                task.correcting_score);
}

std::int64_t Pass::Run(double tolerance, std::int64_t max_steps) {
  std::int64_t steps = 0;
  while (steps < max_steps) {
    Violation worst;
    ActiveTask* task = nullptr;
    for (ActiveTask& candidate : tasks_) {
      const Violation violation = FindViolation(candidate);
      if (violation.amount <= worst.amount) continue;
      worst = violation;
      task = &candidate;
    }
    if (worst.amount <= tolerance) break;
    // Looking through all tasks costs more than a step: stay while this one is worth it.
    const double worthwhile = std::max(tolerance, kStayReduction * worst.amount);
    for (; worst.amount > worthwhile && steps < max_steps; ++steps) {
      Step(*task, worst.raised, ChooseLowered(*task, worst.raised));
      worst = FindViolation(*task);
    }
  }
  return steps;
}

struct HingeTerm {
  double score;
  int label;
  double cost;
};

// The bias that minimizes sum_i C_i max(0, 1 - y_i (score_i + bias)): where the slope of that
// convex piecewise linear function changes sign, the middle where it stays 0.
double OptimalBias(const std::vector<HingeTerm>& terms) {
  std::vector<std::pair<double, double>> kinks;  // bias, rise of the slope
  kinks.reserve(terms.size());
  double slope = 0;
  double total_cost = 0;
  for (const HingeTerm& term : terms) {
    kinks.emplace_back(term.label - term.score, term.cost);
    if (term.label > 0) slope -= term.cost;
    total_cost += term.cost;
  }
  std::sort(kinks.begin(), kinks.end());
  // Sums of equal costs in another order differ by rounding: that is no slope.
  const double rounding = 1e-12 * total_cost;
  for (std::size_t i = 0; i + 1 < kinks.size(); ++i) {
    slope += kinks[i].second;
    if (slope > rounding) return kinks[i].first;
    if (slope >= -rounding) return (kinks[i].first + kinks[i + 1].first) / 2;
  }
  return kinks.back().first;
}

struct Task {
  std::vector<int> variables;
  std::vector<double> correcting_score;  // [n] w_t'phi_t(x)
  double bias = kNan;
  double highest = 0;  // margin bias among coefficients that can rise
  double lowest = 0;   // and among those that can fall; optimal where highest <= lowest
};

class Solver {
 public:
  Solver(const KernelRef& decision_kernel, const KernelRef& correcting_kernel,
         std::span<const DualVariable> variables, int num_tasks,
         const MultitaskSvmOptions& options);
  MultitaskSvmSolution Run();

 private:
  double Lower(int i) const { return variables_[i].label > 0 ? 0 : -variables_[i].cost; }
  double Upper(int i) const { return variables_[i].label > 0 ? variables_[i].cost : 0; }
  double Score(const Task& task, int i) const {
    const int sample = variables_[i].sample_idx;
    return decision_score_[sample] + task.correcting_score[sample];
  }
  double MarginBias(const Task& task, int i) const { return variables_[i].label - Score(task, i); }
  bool IsAbsent(const Task& task) const;
  void ComputeScores();
  void ComputeMarginBiasRange(Task& task);
  void ComputeObjectives();
  double WorstViolation() const;
  void Update();
  std::vector<int> ChooseActive(const Task& task, double band) const;
  std::vector<std::vector<int>> ChooseAllActive(double band) const;
  std::vector<std::vector<int>> ChooseFirstActive();
  Pass MakePass(const std::vector<std::vector<int>>& active) const;
  void Accept(const Pass& pass);
  MultitaskSvmSolution MakeSolution() const;

  const KernelRef& decision_kernel_;
  const KernelRef& correcting_kernel_;
  std::span<const DualVariable> variables_;
  MultitaskSvmOptions options_;
  std::vector<Task> tasks_;             // variables of absent tasks are dropped
  std::vector<double> coefficient_;     // [variables] a_i y_i
  std::vector<double> decision_score_;  // [n] w'phi(x)
  double primal_ = 0;
  double dual_ = 0;
  std::int64_t iterations_ = 0;
};

Solver::Solver(const KernelRef& decision_kernel, const KernelRef& correcting_kernel,
               std::span<const DualVariable> variables, int num_tasks,
               const MultitaskSvmOptions& options)
    : decision_kernel_(decision_kernel),
      correcting_kernel_(correcting_kernel),
      variables_(variables),
      options_(options),
      tasks_(num_tasks),
      coefficient_(variables.size(), 0.0) {
  for (std::size_t i = 0; i < variables.size(); ++i) {
    tasks_[variables[i].task].variables.push_back(static_cast<int>(i));
  }
  for (Task& task : tasks_) {
    if (IsAbsent(task)) task.variables.clear();
  }
}

bool Solver::IsAbsent(const Task& task) const {
  const auto is_positive = [this](int i) { return variables_[i].label > 0; };
  return std::all_of(task.variables.begin(), task.variables.end(), is_positive) ||
         std::none_of(task.variables.begin(), task.variables.end(), is_positive);
}

// From scratch, so that the rounding of many steps does not add up.
void Solver::ComputeScores() {
  const Eigen::Index n = decision_kernel_.rows();
  std::vector<double> sample_coefficient(n, 0.0);
  for (Task& task : tasks_) {
    task.correcting_score.assign(n, 0.0);
    for (int i : task.variables) {
      if (coefficient_[i] == 0) continue;
      const int sample = variables_[i].sample_idx;
      sample_coefficient[sample] += coefficient_[i];
      AddScaled(coefficient_[i] / options_.beta, correcting_kernel_.col(sample).data(),
                task.correcting_score);
    }
  }
  decision_score_.assign(n, 0.0);
  for (Eigen::Index sample = 0; sample < n; ++sample) {
    if (sample_coefficient[sample] == 0) continue;
    AddScaled(sample_coefficient[sample], decision_kernel_.col(sample).data(), decision_score_);
  }
}

void Solver::ComputeMarginBiasRange(Task& task) {
  task.highest = -kInfinity;
  task.lowest = kInfinity;
  for (int i : task.variables) {
    const double margin_bias = MarginBias(task, i);
    if (coefficient_[i] < Upper(i)) task.highest = std::max(task.highest, margin_bias);
    if (coefficient_[i] > Lower(i)) task.lowest = std::min(task.lowest, margin_bias);
  }
}

void Solver::ComputeObjectives() {
  double half_norm2 = 0;  // 1/2 w'w + beta/2 sum_t w_t'w_t
  double sum_alpha = 0;
  double loss = 0;
  std::vector<HingeTerm> terms;
  for (Task& task : tasks_) {
    if (task.variables.empty()) continue;
    terms.clear();
    for (int i : task.variables) {
      terms.push_back({Score(task, i), variables_[i].label, variables_[i].cost});
      half_norm2 += coefficient_[i] * terms.back().score / 2;
      sum_alpha += std::abs(coefficient_[i]);
    }
    task.bias = OptimalBias(terms);
    for (const HingeTerm& term : terms) {
      loss += term.cost * std::max(0.0, 1 - term.label * (term.score + task.bias));
    }
  }
  primal_ = half_norm2 + loss;
  dual_ = sum_alpha - half_norm2;
}

double Solver::WorstViolation() const {
  double worst = 0;
  for (const Task& task : tasks_) worst = std::max(worst, task.highest - task.lowest);
  return worst;
}

void Solver::Update() {
  ComputeScores();
  for (Task& task : tasks_) ComputeMarginBiasRange(task);
  ComputeObjectives();
}

// The free variables, and those at a bound that can pair with another of the task or, within
// `band`, soon may; where they are many, the most promising (the worst pair among them).
std::vector<int> Solver::ChooseActive(const Task& task, double band) const {
  std::vector<int> active;
  std::vector<std::pair<double, int>> risers, fallers;
  for (int i : task.variables) {
    if (coefficient_[i] > Lower(i) && coefficient_[i] < Upper(i)) {
      active.push_back(i);
      continue;
    }
    const bool can_rise = coefficient_[i] <= Lower(i);
    const double slack =
        can_rise ? task.lowest - MarginBias(task, i) : MarginBias(task, i) - task.highest;
    if (slack <= band) (can_rise ? risers : fallers).emplace_back(slack, i);
  }
  for (auto* at_bound : {&risers, &fallers}) {
    std::sort(at_bound->begin(), at_bound->end());
    if (at_bound->size() > kMaxAtBound) at_bound->resize(kMaxAtBound);
    for (const auto& [slack, i] : *at_bound) active.push_back(i);
  }
  std::sort(active.begin(), active.end());
  return active;
}

// At a = 0 all samples of a label look alike. Those nearest to the other label matter: rank
// them by the scores that the positives alone would give.
std::vector<std::vector<int>> Solver::ChooseFirstActive() {
  for (const Task& task : tasks_) {
    for (int i : task.variables) coefficient_[i] = Upper(i);
  }
  ComputeScores();
  std::fill(coefficient_.begin(), coefficient_.end(), 0.0);
  return ChooseAllActive(kInfinity);
}

Pass Solver::MakePass(const std::vector<std::vector<int>>& active) const {
  std::vector<int> row_of_sample(decision_kernel_.rows(), -1);
  for (const auto& task : active) {
    for (int i : task) row_of_sample[variables_[i].sample_idx] = 0;
  }
  std::vector<int> samples;
  std::vector<double> decision_score;
  for (int sample = 0; sample < static_cast<int>(row_of_sample.size()); ++sample) {
    if (row_of_sample[sample] < 0) continue;
    row_of_sample[sample] = static_cast<int>(samples.size());
    samples.push_back(sample);
    decision_score.push_back(decision_score_[sample]);
  }
  std::vector<ActiveTask> active_tasks(tasks_.size());
  for (std::size_t t = 0; t < tasks_.size(); ++t) {
    ActiveTask& task = active_tasks[t];
    for (int i : active[t]) {
      task.variable.push_back(i);
      task.row.push_back(row_of_sample[variables_[i].sample_idx]);
      task.label.push_back(variables_[i].label);
      task.coefficient.push_back(coefficient_[i]);
      task.lower.push_back(Lower(i));
      task.upper.push_back(Upper(i));
    }
    for (int sample : samples) task.correcting_score.push_back(tasks_[t].correcting_score[sample]);
  }
  std::optional<KernelBlock> correcting;
  if (!IsSame(decision_kernel_, correcting_kernel_))
    correcting.emplace(correcting_kernel_, samples);
  return Pass(KernelBlock(decision_kernel_, samples), std::move(correcting), options_.beta,
              std::move(decision_score), std::move(active_tasks));
}

void Solver::Accept(const Pass& pass) {
  for (const ActiveTask& task : pass.tasks()) {
    for (std::size_t i = 0; i < task.variable.size(); ++i) {
      coefficient_[task.variable[i]] = task.coefficient[i];
    }
  }
}

std::vector<std::vector<int>> Solver::ChooseAllActive(double band) const {
  std::vector<std::vector<int>> active;
  for (const Task& task : tasks_) active.push_back(ChooseActive(task, band));
  return active;
}

MultitaskSvmSolution Solver::MakeSolution() const {
  MultitaskSvmSolution solution;
  for (const double coefficient : coefficient_) solution.alpha.push_back(std::abs(coefficient));
  for (const Task& task : tasks_) solution.bias.push_back(task.bias);
  solution.primal = primal_;
  solution.dual = dual_;
  solution.iterations = iterations_;
  solution.converged = primal_ - dual_ <= options_.relative_gap * std::abs(dual_);
  return solution;
}

MultitaskSvmSolution Solver::Run() {
  std::vector<std::vector<int>> active = ChooseFirstActive();
  double best_dual = -kInfinity;
  double best_gap = kInfinity;
  int idle_passes = 0;
  for (;;) {
    Update();
    const double gap = primal_ - dual_;
    idle_passes = gap < best_gap || dual_ > best_dual ? 0 : idle_passes + 1;
    best_gap = std::min(best_gap, gap);
    best_dual = std::max(best_dual, dual_);
    const double violation = WorstViolation();
    if (gap <= options_.relative_gap * std::abs(dual_) || violation <= kViolationFloor ||
        iterations_ >= options_.max_iterations || idle_passes == kMaxIdlePasses) {
      return MakeSolution();
    }
    if (iterations_ > 0) active = ChooseAllActive(violation);
    Pass pass = MakePass(active);
    iterations_ += pass.Run(kPassReduction * violation, options_.max_iterations - iterations_);
    Accept(pass);
  }
}

}  // namespace

MultitaskSvmSolution SolveMultitaskSvm(const Eigen::Ref<const Eigen::MatrixXf>& decision_kernel,
                                       const Eigen::Ref<const Eigen::MatrixXf>& correcting_kernel,
                                       std::span<const DualVariable> variables, int num_tasks,
                                       const MultitaskSvmOptions& options) {
  CheckKernel(decision_kernel);
  if (!IsSame(decision_kernel, correcting_kernel)) CheckKernel(correcting_kernel);
  Require(decision_kernel.rows() == correcting_kernel.rows(), "the kernels differ in size");
  CheckBeta(options.beta);
  CheckVariables(variables, num_tasks, decision_kernel.rows());
  return Solver(decision_kernel, correcting_kernel, variables, num_tasks, options).Run();
}

}  // namespace viewfix
