// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/features/feature_extractor.h"
#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/experiment/method.h"
#include "firmware_tools/experiment/prediction_time.h"
#include "firmware_tools/experiment/selection.h"
#include "firmware_tools/experiment/splits.h"
#include "firmware_tools/training/labels.h"
#include "firmware_tools/training/trainer.h"

namespace viewfix {

// The paper's experiment (method.md, section 3): every method on the same histograms and splits.
struct ExperimentOptions {
  FeatureOptions features;
  int num_words = 500;        // 2..65535; the paper's
  int words_per_feature = 3;  // as TrainOptions
  HistogramMap histogram_map = HistogramMap::kHellinger;
  LabelOptions labels;
  int max_locations = 0;  // those with the most training images; 0: all
  int splits = 10;        // >= 1
  int folds = 4;          // of held-out blocks, >= 2
  std::uint64_t seed = 1;
  int jobs = 0;  // 0: all cores
};

// A test image; -1: not labelled.
struct Truth {
  int image_idx = 0;
  int location = -1;  // into ExperimentResult::locations
  int view = -1;      // into ExperimentResult::views
};

// Of one prediction, from a histogram in memory, on one thread.
struct PredictionCost {
  PredictionTime time;       // beside the first method's
  double multiply_adds = 0;  // mean over the test images
};

struct MethodResult {
  std::string name;
  bool tells_views = false;
  int own_view = -1;                         // into views: the one a single-view method knows
  std::vector<std::string> parameter_names;  // of Selection::values
  std::vector<Selection> selections;         // [splits]
  std::vector<std::vector<Answer>> answers;  // [splits][tests]; into locations and views
  PredictionCost cost;
};

// Correlation scores of one location's test images, eq. (5) by our method (Fig. 4a of the paper).
struct ScoreTable {
  struct Row {
    int image_idx = 0;
    int view = -1;
    std::vector<float> scores;  // [columns]
  };
  int location = -1;
  std::vector<int> column_location;
  std::vector<int> column_view;
  std::vector<Row> rows;  // test images of `location`
};

struct ExperimentResult {
  std::vector<std::string> locations;
  std::vector<std::string> views;
  std::string location_source;  // of Labels
  std::string view_source;
  bool first_split_is_own = false;
  bool drawn_as_runs = false;
  int samples = 0;
  std::vector<std::vector<Truth>> truths;  // [splits][tests]
  std::vector<MethodResult> methods;
  ScoreTable scores;  // of the first split
  // svm_one_vs_rest as libsvm itself predicts, by a sum over support vectors.
  PredictionCost libsvm_cost;
  std::vector<std::string> warnings;
};

// Runs it. For each split: the vocabulary is made from its training images, all methods choose
// their parameters on held-out blocks of these, train, and are asked for its test images.
// The same inputs give the same answers, whatever `jobs` is; times are measured at the end, all
// methods in turn. Throws ToolError naming the set.
ExperimentResult RunExperiment(const ImageSet& set, const ExperimentOptions& options,
                               const StageProgress& stages);

}  // namespace viewfix
