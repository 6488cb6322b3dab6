// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "engine/localizer.h"
#include "firmware_tools/common/parallel.h"
#include "firmware_tools/dataset/image_set.h"
#include "models/model_view.h"

namespace viewfix {

// What the engine said of one image, beside the truth.
struct FrameResult {
  int image_idx = 0;
  Fix fix;
  std::string location;  // best guess; empty: none
  std::string view;
  int location_rank = 0;         // of the right location among all by score, from 1; 0: unknown
  std::string scored_location;   // best by eq. (5) alone, keyframes left out
  std::string nearest_location;  // location of the nearest keyframe of all
  int nearest_rank = 0;          // rank, from 1, of the first keyframe of the right location
  std::string keyframe;          // photograph of the fix's keyframe; empty: none, or not told
  std::string right_keyframe;    // of the first keyframe of the right location, likewise
  // Where the camera was found and where it was, metres: Evaluation::positions_in.
  std::optional<Eigen::Vector3d> position;
  std::optional<Eigen::Vector3d> true_position;
  std::optional<double> keyframe_distance;   // metres from the truth to the fix's keyframe
  std::optional<double> keyframe_angle_deg;  // between their viewing poses
  std::optional<double> translation_error;   // metres, of the fix's pose
  std::optional<double> rotation_error_deg;
};

struct EvaluateOptions {
  enum class Split { kTest, kTrain, kAll };
  Split split = Split::kTest;
  // As a moving camera: frames in the set's order, each capture a walk of its own, and each frame
  // first looked for where the frames before it lead.
  bool sequence = false;
  bool filter = false;  // of a sequence: agreement over its frames (engine/fix_filter.h)
  int window = 0;       // of a sequence: LocalizerOptions::window
};

struct Evaluation {
  std::vector<FrameResult> frames;
  std::vector<std::string> skipped;  // images that could not be read, with the cause
  std::size_t model_bytes = 0;
  // Of a map that is not metric: registered training images, and what is left of their
  // positions' errors after the map was laid over them, metres.
  struct Alignment {
    int images = 0;
    double rmse = 0;
    double median = 0;
  };
  std::optional<Alignment> alignment;
  // Of positions: the model's site coordinates, or, where the map is not metric, the set's.
  enum class Frame { kSite, kSet };
  Frame positions_in = Frame::kSite;
  bool model_has_view_labels = false;  // its views are those of the set's `view` column
};

// Localizes each image of the split, alone or as a sequence, one after another on one thread, so
// that the times are those of one core. Poses of a map that is not metric are compared after a
// similarity that lays the largest map's keyframes over the poses of the set's training images;
// without one, and in smaller maps, they count as not localized. Those of a map that control points
// moved away from the set's poses are compared after moving it back. Throws ToolError: no images in
// the split, or more than a fifth of them unreadable.
Evaluation Evaluate(const ImageSet& set, const ModelView& model, const EvaluateOptions& options,
                    const Progress& progress);

// The bytes of a model's parts.
nlohmann::ordered_json SectionsAsJson(const ModelView& model);

// The figures of interfaces.md, `eval --json`. `unknown` may be null.
nlohmann::ordered_json FiguresAsJson(const ImageSet& set, const Evaluation& evaluation,
                                     const Evaluation* unknown);

// The figures of a sequence in the same form, with the share of frames that were tracked. What
// needs every frame's scores is that of the frames alone; so is all of `frame_alone`.
nlohmann::ordered_json SequenceAsJson(const ImageSet& set, const Evaluation& sequence,
                                      const nlohmann::ordered_json& alone);

}  // namespace viewfix
