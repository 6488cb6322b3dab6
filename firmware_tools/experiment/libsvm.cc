// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/experiment/libsvm.h"

#include <svm.h>

#include <algorithm>
#include <memory>
#include <mutex>
#include <stdexcept>

namespace viewfix {
namespace {

void BeSilent(const char*) {}

void Silence() {
  static std::once_flag silent;
  std::call_once(silent, [] { svm_set_print_string_function(BeSilent); });
}

struct FreeModel {
  void operator()(svm_model* model) const { svm_free_and_destroy_model(&model); }
};

using Model = std::unique_ptr<svm_model, FreeModel>;

void Check(std::span<const int> samples, std::span<const int> labels, double c) {
  const auto is_one = [](int label) { return label == 1 || label == -1; };
  const bool both = std::count(labels.begin(), labels.end(), 1) > 0 &&
                    std::count(labels.begin(), labels.end(), -1) > 0;
  if (samples.size() != labels.size() || !both || !(c > 0) ||
      !std::all_of(labels.begin(), labels.end(), is_one)) {
    throw std::invalid_argument("SVM: needs samples with labels +1 and -1, both, and C > 0");
  }
}

// libsvm's form of a precomputed kernel: a row begins with its own number.
std::vector<svm_node> KernelRow(const Eigen::MatrixXf& kernel, std::span<const int> samples,
                                int row) {
  std::vector<svm_node> nodes = {{0, row + 1.0}};
  nodes.reserve(samples.size() + 2);
  for (int j = 0; j < static_cast<int>(samples.size()); ++j) {
    nodes.push_back({j + 1, double{kernel(samples[j], samples[row])}});
  }
  nodes.push_back({-1, 0});
  return nodes;
}

svm_parameter ParametersOf(int kernel_type, double c, double tolerance) {
  svm_parameter parameter = {};
  parameter.svm_type = C_SVC;
  parameter.kernel_type = kernel_type;
  parameter.cache_size = 64;  // MB
  parameter.eps = tolerance;
  parameter.C = c;
  parameter.shrinking = 1;
  return parameter;
}

std::vector<svm_node> SparseRow(const Histogram& histogram) {
  std::vector<svm_node> nodes;
  nodes.reserve(histogram.size() + 1);
  for (int e = 0; e < histogram.size(); ++e) {
    nodes.push_back({histogram.words[e] + 1, double{histogram.values[e]}});
  }
  nodes.push_back({-1, 0});
  return nodes;
}

class LibsvmPredictor : public Predictor {
 public:
  // `rows` hold the support vectors: libsvm keeps pointers to them.
  LibsvmPredictor(std::vector<std::vector<svm_node>> rows, std::vector<Model> models)
      : rows_(std::move(rows)), models_(std::move(models)) {}

  Answer Predict(const Histogram& histogram) const override {
    const std::vector<svm_node> x = SparseRow(histogram);
    Answer answer;
    double best = 0;
    for (int l = 0; l < static_cast<int>(models_.size()); ++l) {
      double value = 0;
      svm_predict_values(models_[l].get(), x.data(), &value);
      value *= models_[l]->label[0];
      if (l > 0 && value <= best) continue;
      best = value;
      answer.location = l;
    }
    return answer;
  }

  double MultiplyAdds(const Histogram& histogram) const override {
    double support_vectors = 0;
    for (const Model& model : models_) support_vectors += model->l;
    return support_vectors * histogram.size();
  }

 private:
  std::vector<std::vector<svm_node>> rows_;
  std::vector<Model> models_;  // [locations]
};

}  // namespace

BinarySvm TrainLibsvm(const Eigen::MatrixXf& kernel, std::span<const int> samples,
                      std::span<const int> labels, double c, double tolerance) {
  Check(samples, labels, c);
  Silence();
  const int n = static_cast<int>(samples.size());
  std::vector<std::vector<svm_node>> rows;
  std::vector<svm_node*> row_starts;
  for (int i = 0; i < n; ++i) rows.push_back(KernelRow(kernel, samples, i));
  for (auto& row : rows) row_starts.push_back(row.data());
  std::vector<double> targets(labels.begin(), labels.end());
  const svm_problem problem = {n, targets.data(), row_starts.data()};
  const svm_parameter parameter = ParametersOf(PRECOMPUTED, c, tolerance);
  const Model model(svm_train(&problem, &parameter));
  const double sign = model->label[0];  // what a positive decision stands for
  BinarySvm svm;
  for (int i = 0; i < model->l; ++i) {
    svm.terms.emplace_back(samples[model->sv_indices[i] - 1], sign * model->sv_coef[0][i]);
  }
  svm.bias = -sign * model->rho[0];
  return svm;
}

std::unique_ptr<Predictor> TrainLibsvmOneVsRest(std::span<const Histogram> histograms,
                                                std::span<const int> locations, int num_locations,
                                                double c) {
  Silence();
  std::vector<std::vector<svm_node>> rows;
  for (const Histogram& h : histograms) rows.push_back(SparseRow(h));
  std::vector<svm_node*> row_starts;
  for (auto& row : rows) row_starts.push_back(row.data());
  const svm_parameter parameter = ParametersOf(LINEAR, c, 1e-3);
  std::vector<Model> models;
  for (int l = 0; l < num_locations; ++l) {
    std::vector<double> targets;
    for (const int location : locations) targets.push_back(location == l ? 1 : -1);
    const svm_problem problem = {static_cast<int>(rows.size()), targets.data(), row_starts.data()};
    models.emplace_back(svm_train(&problem, &parameter));
  }
  return std::make_unique<LibsvmPredictor>(std::move(rows), std::move(models));
}

}  // namespace viewfix
