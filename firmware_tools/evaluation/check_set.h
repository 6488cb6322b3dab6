// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/training/trainer.h"

namespace viewfix {

enum class Severity { kError, kWarning, kNote };
const char* SeverityName(Severity severity);  // "error", "warning", "note"

// One thing that is wrong or thin in an image set. An error: `train` would refuse the set, or
// learn what is false.
struct Finding {
  Severity severity = Severity::kWarning;
  std::string kind;                         // "unreadable", "blurred", "thin_location", ...
  std::string text;                         // for the person with the camera
  std::vector<std::string> images = {};     // concerned, paths as in the set
  std::vector<std::string> locations = {};  // concerned
};

// How held-out images of one (location, view) fared.
struct ExpectedRecall {
  std::string location, view;
  int images = 0;
  int held_out = 0;
  int right = 0;                 // the location was found
  std::string mostly_taken_for;  // the location that most of the wrong ones were taken for
};

struct CheckReport {
  int images = 0;
  int train_images = 0;
  std::vector<Finding> findings;          // errors first
  std::vector<ExpectedRecall> recall;     // empty where nothing could be held out
  double expected_location_accuracy = 0;  // over all held-out images
  double expected_view_accuracy = 0;      // likewise
};

// Counts alone: thin locations, single, missing and unbalanced views, locations that only the
// test split has. Reads no image.
std::vector<Finding> CheckLabels(const ImageSet& set);

// From features: breaks in walks, images of different locations that show the same. Matches
// about two pairs of images for each image, on `jobs` threads (0: all cores).
std::vector<Finding> CheckAppearance(const ImageSet& set, const Preparation& prepared, int jobs = 0,
                                     const StageProgress& stages = {});

// Everything: the above, each image's pixels, and the recall to expect from blocks of
// neighbouring images held out of the training split. Whatever is wrong with the set becomes a
// finding; throws ToolError only where the options are at fault, and what `stages` throws.
CheckReport CheckImageSet(const ImageSet& set, const TrainOptions& options,
                          const StageProgress& stages);

nlohmann::ordered_json ToJson(const CheckReport& report);

}  // namespace viewfix
