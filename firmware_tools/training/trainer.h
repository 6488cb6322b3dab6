// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/mapping/floor_plan.h"
#include "firmware_tools/mapping/model_map.h"
#include "firmware_tools/mapping/site_map.h"
#include "firmware_tools/training/base_model.h"
#include "firmware_tools/training/details.h"
#include "firmware_tools/training/feature_store.h"
#include "firmware_tools/training/labels.h"
#include "firmware_tools/training/pose_confidence.h"
#include "firmware_tools/training/score_training.h"
#include "models/model_writer.h"

namespace viewfix {

struct TrainOptions {
  FeatureOptions features;
  int num_words = 500;  // 2..65535
  // Words that a frame's feature votes for, 1..4. 3 by held-out frames of the IE Tower's
  // training split: 75.8 % of areas right where 1 gives 73.5 (2000 words); 4 as good as 3.
  int words_per_feature = 3;
  HistogramMap histogram_map = HistogramMap::kHellinger;
  LabelOptions labels;
  // Chosen by cross-validation on the training split where not given.
  std::optional<double> c;
  std::optional<double> beta;
  std::optional<bool> other_views_negative;
  int folds = 4;  // of held-out blocks, >= 2
  // Share, 0..1, of the answers by scores alone that may be wrong, by held-out blocks, which lie
  // farther from the images left than frames of the same walks will: with each fifth of the IE
  // Tower's training images put aside, 0.05 made 0.8 % of the answers to those wrong (43 %
  // answered), 0.03 none (27 %), 0.02 none (3 %).
  double wrong_share = 0.05;
  SiteMapOptions map;  // where landmarks come from
  // Of an image, for a map from photographs alone: more hold it together better than what a board
  // has time for. No fewer than features.max_features are taken. Given poses need no more.
  int map_features = 1500;
  ModelMapOptions model_map;
  PoseConfidenceOptions pose_confidence;
  DetailOptions details;                // where there are no landmarks
  std::optional<FloorPlan> floor_plan;  // goes into the model as it is
  // What is to stay as it is (TakeFrozenOptions()); null: nothing.
  std::shared_ptr<const BaseModel> base;
  // Keeps features, vocabulary and matched pairs from run to run; the model is the same with and
  // without. Null: nothing is kept.
  std::shared_ptr<StageCache> cache;
  std::uint64_t seed = 1;
  int jobs = 0;  // 0: all cores
};

// Sets `base`, and what it decides: features, vocabulary, histograms, the SVM's parameters, and what
// share of the answers may be wrong.
void TakeFrozenOptions(std::shared_ptr<const BaseModel> base, TrainOptions& options);

// Begins a named stage of long work and returns where to report its progress.
using StageProgress = std::function<Progress(const std::string& stage)>;

// What a training knows after its photographs are read: kept apart from the model so that
// `check` can report on a set without writing one.
struct Preparation {
  FeatureStore features;
  std::optional<FeatureStore> map_features;    // where the map has more of them
  std::vector<std::int8_t> words;              // [num_words, dim]
  std::vector<Histogram> histograms;           // [samples] as of frames
  std::vector<Histogram> keyframe_histograms;  // [samples]
  Eigen::MatrixXf gram;                        // [samples, samples]
  Eigen::MatrixXf similarities;                // [samples as keyframes, samples as frames]
  Labels labels;
  SiteMap site;
  std::vector<std::string> warnings;

  const FeatureStore& MapFeatures() const { return map_features ? *map_features : features; }
};

// Features of the training split. Images that fail are in FeatureStore::failures.
FeatureStore ExtractTrainingFeatures(const ImageSet& set, const TrainOptions& options,
                                     const StageProgress& stages);

// Vocabulary, histograms and labels of whatever features there are.
Preparation PrepareFeatures(const ImageSet& set, FeatureStore features, const TrainOptions& options,
                            const StageProgress& stages);

// Both, with the limits of a training: images that fail are warned of, skipped and counted;
// throws ToolError where more than a fifth fail or a location is left empty.
Preparation Prepare(const ImageSet& set, const TrainOptions& options, const StageProgress& stages);

// Cross-validation of the score parameters over held-out blocks; the first is the best.
std::vector<HeldOut> ChooseScoreOptions(const Preparation& prepared, const TrainOptions& options,
                                        const StageProgress& stages);

struct TrainResult {
  ModelData model;
  HeldOut chosen;  // the parameters taken, and how held-out blocks fared with them
  std::vector<Outcome> details_held_out;  // of TrainedDetails; empty: no details
  std::vector<Outcome> details_elsewhere;
  BaseReport base;  // where there is one
};

// The model of a prepared set. The same inputs give the same model, whatever `jobs` is.
TrainResult Train(const ImageSet& set, const Preparation& prepared, const TrainOptions& options,
                  const StageProgress& stages);

}  // namespace viewfix
