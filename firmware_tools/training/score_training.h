// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "engine/vocabulary/vocabulary.h"
#include "firmware_tools/common/parallel.h"
#include "firmware_tools/training/labels.h"
#include "firmware_tools/training/multitask_svm.h"
#include "models/model_view.h"

namespace viewfix {

// Parameters of the multi-task SVM, eq. (2) of the method.
struct ScoreOptions {
  double c = 10;    // cost of a sample on the wrong side; > 0
  double beta = 1;  // > 0; large: a location's views share one direction
  // Whether a view's negatives include the same location's other views.
  bool other_views_negative = false;
  LocationRule rule = LocationRule::kBestPair;  // how pairs' scores make a location's
  // How much a pair's most similar keyframe adds to its score (engine/scoring/scoring.h).
  // 2 by held-out frames of the IE Tower's training split: the 20 best areas hold the right
  // one in 97.7 % of them, 96.7 % without; larger weights cost accuracy.
  double keyframe_weight = 2;
};

// One location's solution as a sum over samples, eq. (4): pair task t scores a sample s by
//   sum_i coefficient_i (K(i, s) + [task_i == t] K(i, s) / beta) + bias_t
struct LocationModel {
  struct Term {
    int sample = 0;
    int task = 0;
    double coefficient = 0;  // a_i y_i
  };
  std::vector<int> pairs;    // [tasks] the pairs that are this location's tasks
  std::vector<double> bias;  // [tasks]; NaN: absent
  std::vector<Term> terms;
  double beta = 1;
};

// Trains one location on the samples marked in `used`. Global views take the paper's tasks
// (view t of all locations); local views make every other location's image a negative of
// each task, its cost divided by the number of tasks (method.md, section 1).
LocationModel TrainLocation(const Labels& labels, const Eigen::MatrixXf& gram, int location,
                            const std::vector<bool>& used, const ScoreOptions& options);

// What takes part in the tasks of one location, the pairs `pairs`, of the samples in `used`.
std::vector<DualVariable> LocationVariables(const Labels& labels, const std::vector<int>& pairs,
                                            const std::vector<bool>& used,
                                            const ScoreOptions& options);

// Scores of `sample` by the location's tasks, [tasks]; absent tasks score -infinity.
std::vector<double> ScoreSample(const LocationModel& model, const Eigen::MatrixXf& gram,
                                int sample);

// The whole training set's models collapsed to one vector and bias for each pair, eq. (5).
struct ScoreModel {
  Eigen::MatrixXf weights;  // [words, pairs]
  std::vector<float> bias;  // [pairs]
};
ScoreModel TrainScores(const Labels& labels, const Eigen::MatrixXf& gram,
                       std::span<const Histogram> histograms, int num_words,
                       const ScoreOptions& options, int jobs, const Progress& progress);

// What held-out samples were taken for.
struct HeldOut {
  struct Prediction {
    int sample = 0;
    int location = -1;
    int pair = -1;
    double margin = 0;  // best location's score less the best other's
  };
  ScoreOptions options;
  std::vector<Prediction> predictions;  // by sample
  double location_accuracy = 0;
  double view_accuracy = 0;  // share with the right pair's view, whatever the location
};

// What options are chosen by: views count where they mean something beyond the location.
double Merit(const Labels& labels, const HeldOut& result);

// Fold of each sample: every pair's images, in order, are cut into contiguous blocks, so
// that a held-out image's neighbours in the walk are held out with it. -1: never held out
// (a location's only images).
std::vector<int> HeldOutBlocks(const Labels& labels, int folds);

// Cross-validation of several options over the same folds; results in the same order.
// For each option the rule that does better on the held-out samples is taken.
//   gram, similarities   of histograms.h
std::vector<HeldOut> CrossValidate(const Labels& labels, const Eigen::MatrixXf& gram,
                                   const Eigen::MatrixXf& similarities,
                                   std::span<const int> fold_of_sample, int folds,
                                   std::span<const ScoreOptions> candidates, int jobs,
                                   const Progress& progress);

}  // namespace viewfix
