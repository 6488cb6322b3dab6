// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "engine/pose/pose_confidence.h"
#include "firmware_tools/common/parallel.h"
#include "firmware_tools/dataset/image_set.h"
#include "models/model_writer.h"

namespace viewfix {

// A pose that frames held out were given, what spoke for it, and whether it was right.
struct PoseOutcome {
  PoseCues cues = {};
  bool right = false;
  bool of_hidden_place = false;  // its location was taken out of the model
};

struct PoseConfidenceOptions {
  // Every so many images of a location and view are held out: so near to those that are left as a
  // visitor's frame is to the photographs of the site.
  int hold_out = 5;
  // What a frame of a place that is not in the model counts for, where one that is counts one: of
  // look-alike places one taken out is named after its twin, which no cue can tell. The museum,
  // seed 4: with 1, a tenth of the right poses would be withheld, with 0.3 one in thirty.
  double hidden_weight = 0.3;
  // Share of the answers to frames of places in the model that may be wrong; answers are withheld
  // where held-out frames speak against it beyond a chance of so much.
  double wrong_share = 0.005;
  double chance = 0.05;
  int jobs = 0;  // 0: all cores
};

// A model of a part of the training images.
struct PartialModel {
  ModelData model;
  std::vector<int> map_idx;  // [its maps] of the whole model's
};

struct PoseConfidenceSource {
  const ImageSet& set;
  std::span<const int> image_idxs;  // [samples]
  std::span<const int> locations;   // [samples]
  std::span<const int> pairs;       // [samples] of location and view
  const ModelData& model;           // the whole one: its keyframes' poses are the truth
  std::function<PartialModel(const std::vector<bool>& hidden)> without;  // [samples] that go
};

// Poses that models without the frame itself, and models without its location, give to held-out
// training images. Right is a pose within half a metre (where units are no metres, a tenth of the
// median distance of what the image shows) and 10 degrees of the truth; where there is no truth,
// one that names the right location. Poses that the fixed
// rules refuse (PoseFinderOptions) and ambiguous ones are left out. The same whatever `jobs` is.
std::vector<PoseOutcome> HoldOutPoses(const PoseConfidenceSource& source,
                                      const PoseConfidenceOptions& options,
                                      const Progress& progress = {});

// Logistic regression with a small ridge and Platt's smoothed targets; a cue that would count
// against a pose is left out. The threshold is one half, or more where else more than wrong_share
// of the answers to frames of places in the model were wrong (LimitWrongAnswers).
ModelPoseConfidence FitPoseConfidence(std::span<const PoseOutcome> outcomes,
                                      const PoseConfidenceOptions& options);

}  // namespace viewfix
