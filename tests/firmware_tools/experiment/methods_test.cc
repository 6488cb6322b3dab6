// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <memory>
#include <stdexcept>

#include "firmware_tools/experiment/libsvm.h"
#include "firmware_tools/experiment/multitask_methods.h"
#include "firmware_tools/experiment/nearest_neighbour.h"
#include "firmware_tools/experiment/prediction_time.h"
#include "firmware_tools/experiment/selection.h"
#include "firmware_tools/experiment/svm_methods.h"
#include "firmware_tools/training/multitask_svm.h"
#include "tests/firmware_tools/experiment/synthetic_site.h"

namespace viewfix {
namespace {

using testing::ExperimentSite;

std::vector<double> Starts(const Method& method) {
  std::vector<double> values;
  for (const Parameter& p : method.parameters()) values.push_back(p.start);
  return values;
}

std::vector<std::unique_ptr<Method>> AllMethods() {
  std::vector<std::unique_ptr<Method>> methods;
  methods.push_back(std::make_unique<MultitaskSvm>());
  methods.push_back(std::make_unique<IndependentSvm>());
  methods.push_back(std::make_unique<PooledSvm>());
  methods.push_back(std::make_unique<OneVsRestSvm>());
  methods.push_back(std::make_unique<NearestNeighbour>());
  methods.push_back(std::make_unique<SparseTrace>());
  methods.push_back(std::make_unique<ClusteredLearning>());
  methods.push_back(std::make_unique<StructureLearning>());
  return methods;
}

TEST(Methods, FindLocationsOfHeldOutImages) {
  const ExperimentSite site;
  const TrainingData data = site.Data(false);
  for (const auto& method : AllMethods()) {
    const auto predictor = method->Train(data, Starts(*method));
    int asked = 0;
    int right = 0;
    for (std::size_t s = 0; s < data.used.size(); ++s) {
      if (data.used[s]) continue;
      const Answer answer = predictor->Predict(data.histograms[s]);
      ++asked;
      right += answer.location == site.labels.location[s] ? 1 : 0;
      EXPECT_EQ(answer.view >= 0, method->tells_views()) << method->name();
    }
    EXPECT_GE(right, asked * 8 / 10) << method->name();
    EXPECT_GT(predictor->MultiplyAdds(data.histograms[0]), 0) << method->name();
  }
}

TEST(Methods, NearestNeighbourKnowsItsTrainingImages) {
  const ExperimentSite site;
  const auto predictor = NearestNeighbour().Train(site.Data(), {});
  for (int s = 0; s < static_cast<int>(site.histograms.size()); ++s) {
    const Answer answer = predictor->Predict(site.histograms[s]);
    EXPECT_EQ(answer.location, site.labels.location[s]);
    EXPECT_EQ(answer.view, site.ViewOf(s));
  }
}

// A view of which no location has an image leaves a single-view SVM without answers.
TEST(Methods, SingleViewSvmKnowsItsViewAlone) {
  const ExperimentSite site;
  const SingleViewSvm left("left");
  EXPECT_EQ(left.name(), "svm_view_left");
  const std::vector<double> cost = {10};
  int right = 0;
  const auto predictor = left.Train(site.Data(), cost);
  for (int s = 0; s < static_cast<int>(site.histograms.size()); ++s) {
    const Answer answer = predictor->Predict(site.histograms[s]);
    EXPECT_EQ(answer.view, -1);
    if (site.ViewOf(s) == 0) right += answer.location == site.labels.location[s] ? 1 : 0;
  }
  EXPECT_EQ(right, ExperimentSite::kLocations * ExperimentSite::kImages);
  EXPECT_EQ(SingleViewSvm("up").Train(site.Data(), cost)->Predict(site.histograms[0]).location, -1);
}

TEST(PooledSvm, ViewsOfALocationShareTheirWeights) {
  const ExperimentSite site;
  const std::vector<double> values = {10, 1};
  const auto predictor = PooledSvm().Train(site.Data(), values);
  const auto* linear = dynamic_cast<const LinearPredictor*>(predictor.get());
  ASSERT_NE(linear, nullptr);
  Histogram word;
  word.words = {7};
  word.counts = {1};
  word.values = {1};
  const std::vector<float> bias = linear->Scores(Histogram());
  const std::vector<float> scores = linear->Scores(word);
  ASSERT_EQ(scores.size(), 12U);
  for (int c = 0; c < 12; ++c) {
    EXPECT_NEAR(scores[c] - bias[c], scores[c / 3 * 3] - bias[c / 3 * 3], 1e-4);
  }
}

TEST(LinearPredictor, SumAndBestRulesDiffer) {
  using Column = LinearPredictor::Column;
  const auto column = [](int location, int view, double weight) {
    return Column{location, view, 0.0, Eigen::VectorXd::Constant(1, weight)};
  };
  const std::vector<Column> columns = {column(0, 0, 3), column(0, 1, -4), column(1, 0, 1),
                                       column(1, 1, 2)};
  Histogram h;
  h.words = {0};
  h.counts = {1};
  h.values = {1};
  const Answer best = LinearPredictor(columns, 1, 3).Predict(h);
  EXPECT_EQ(best.location, 0);
  EXPECT_EQ(best.view, 0);
  const Answer sum = LinearPredictor(columns, 1, 3, ColumnRule::kSum).Predict(h);
  EXPECT_EQ(sum.location, 1);
  EXPECT_EQ(sum.view, 1);
  EXPECT_EQ(LinearPredictor({}, 1, 3).Predict(h).location, -1);
}

double Score(const BinarySvm& svm, const Eigen::MatrixXf& gram, int s) {
  double score = svm.bias;
  for (const auto& [row, coefficient] : svm.terms) score += coefficient * double{gram(row, s)};
  return score;
}

// One task with beta -> infinity is a plain SVM: our solver and libsvm agree.
TEST(Libsvm, AgreesWithGeneralizedSmo) {
  const ExperimentSite site;
  for (const double c : {0.3, 3.0, 100.0}) {
    std::vector<int> samples;
    std::vector<int> labels;
    std::vector<DualVariable> variables;
    for (int s = 0; s < static_cast<int>(site.histograms.size()); ++s) {
      samples.push_back(s);
      labels.push_back(site.labels.location[s] == 1 ? 1 : -1);
      variables.push_back({s, 0, labels.back(), c});
    }
    const BinarySvm theirs = TrainLibsvm(site.gram, samples, labels, c, 1e-8);
    MultitaskSvmOptions options;
    options.beta = 1e30;
    options.relative_gap = 1e-13;
    const auto ours = SolveMultitaskSvm(site.gram, site.gram, variables, 1, options);
    for (const int at : samples) {
      double score = ours.bias[0];
      for (const int s : samples) score += ours.alpha[s] * labels[s] * double{site.gram(s, at)};
      EXPECT_NEAR(Score(theirs, site.gram, at), score, 1e-4) << c;
    }
  }
}

TEST(Libsvm, RefusesOneLabelAlone) {
  const Eigen::MatrixXf gram = Eigen::MatrixXf::Identity(2, 2);
  const std::vector<int> samples = {0, 1};
  EXPECT_THROW(TrainLibsvm(gram, samples, std::vector<int>{1, 1}, 1), std::invalid_argument);
  EXPECT_THROW(TrainLibsvm(gram, samples, std::vector<int>{1, 2}, 1), std::invalid_argument);
  EXPECT_THROW(TrainLibsvm(gram, samples, std::vector<int>{1}, 1), std::invalid_argument);
  EXPECT_THROW(TrainLibsvm(gram, samples, std::vector<int>{1, -1}, 0), std::invalid_argument);
}

// Tells right locations with one value of its parameter alone.
class Stub : public Method {
 public:
  std::string name() const override { return "stub"; }
  bool tells_views() const override { return true; }
  std::vector<Parameter> parameters() const override {
    return {{"unused", {1, 2}, 1}, {"good", {0, 1, 2}, 0}};
  }
  std::unique_ptr<Predictor> Train(const TrainingData& data,
                                   std::span<const double> values) const override {
    if (values[1] == 2) return NearestNeighbour().Train(data, {});
    return std::make_unique<LinearPredictor>(std::vector<LinearPredictor::Column>(), data.num_words,
                                             4);
  }
};

TEST(SelectParameters, TakesWhatHeldOutBlocksSay) {
  const ExperimentSite site;
  int calls = 0;
  int last = 0;
  int total = 0;
  const Selection selection = SelectParameters(Stub(), site.Data(), 4, 2, [&](int done, int of) {
    ++calls;
    last = done;
    total = of;
  });
  EXPECT_EQ(selection.values, (std::vector<double>{1, 2}));
  EXPECT_GT(selection.merit, 1);
  EXPECT_EQ(last, total);
  EXPECT_EQ(calls, total);
}

TEST(SelectParameters, IsTheSameWithAnyNumberOfThreads) {
  const ExperimentSite site;
  const Selection one = SelectParameters(MultitaskSvm(), site.Data(), 4, 1);
  const Selection three = SelectParameters(MultitaskSvm(), site.Data(), 4, 3);
  EXPECT_EQ(one.values, three.values);
  EXPECT_EQ(one.merit, three.merit);
}

TEST(MeasurePredictionTimes, GivesOneForEach) {
  const ExperimentSite site;
  std::vector<std::unique_ptr<Predictor>> predictors;
  predictors.push_back(NearestNeighbour().Train(site.Data(), {}));
  predictors.push_back(NearestNeighbour().Train(site.Data(), {}));
  const auto times = MeasurePredictionTimes(predictors, site.histograms);
  ASSERT_EQ(times.size(), 2U);
  for (const PredictionTime& time : times) {
    EXPECT_GT(time.ms, 0);
    EXPECT_LE(time.ms_ci95.low, time.ms);
    EXPECT_GE(time.ms_ci95.high, time.ms);
  }
  EXPECT_EQ(times[0].times_first, 1);
  EXPECT_EQ(times[0].times_first_ci95.high, 1);
  EXPECT_EQ(MeasurePredictionTimes(predictors, {})[1].ms, 0);
}

TEST(SummarizeRounds, WhatSlowsBothLeavesTheirRatio) {
  const std::vector<double> first = {1, 1.25, 2, 1, 8, 1.5, 1};
  std::vector<double> ms;
  for (const double m : first) ms.push_back(3 * m);
  const PredictionTime time = SummarizeRounds(ms, first);
  EXPECT_EQ(time.ms, 3.75);
  EXPECT_LT(time.ms_ci95.low, 3.75);
  EXPECT_GT(time.ms_ci95.high, 3.75);
  EXPECT_EQ(time.times_first, 3);
  EXPECT_EQ(time.times_first_ci95.low, 3);
  EXPECT_EQ(time.times_first_ci95.high, 3);
}

TEST(SummarizeRounds, RoundsThatAgreeHaveNoWidth) {
  const PredictionTime time = SummarizeRounds(std::vector<double>(9, 2.0), std::vector(9, 4.0));
  EXPECT_EQ(time.ms_ci95.low, 2);
  EXPECT_EQ(time.ms_ci95.high, 2);
  EXPECT_EQ(time.times_first, 0.5);
}

}  // namespace
}  // namespace viewfix
