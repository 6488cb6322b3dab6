// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "firmware_tools/common/stage_cache.h"
#include "firmware_tools/mapping/colmap_mapper.h"
#include "firmware_tools/mapping/look_alikes.h"
#include "firmware_tools/mapping/missing_tracks.h"
#include "firmware_tools/mapping/pair_consistency.h"
#include "firmware_tools/mapping/register_frames.h"
#include "firmware_tools/mapping/triangulate.h"

namespace viewfix {

struct SfmOptions {
  TwoViewOptions two_view;
  ConsistencyOptions consistency;
  LookAlikeOptions look_alikes;
  MissingTrackOptions missing_tracks;
  ColmapOptions colmap;
  // While poses are adjusted: what disagrees with a bent map must be heard, or it stays bent; and
  // the adjustment must come to its end. On one walk, from maps 11 and 5 cm off: to 3.3 and 2.9 cm.
  TriangulateOptions adjusting{
      .max_error_px = 6,
      .adjustments = 2,
      .adjust = {.poses = true, .readout = true, .max_iterations = 60, .function_tolerance = 1e-6}};
  TriangulateOptions triangulate;  // of the map, once its poses stand
  RegisterOptions registration;
  int refinements = 3;  // rounds of: match under the poses, triangulate, adjust, register
  int min_frames = 10;  // of a map that is worth keeping
  int max_maps = 64;     // of places that are not connected
  double max_image_error_deg = 5;  // median disagreement of an image with its pairs' rotations
  int min_sure_matches = 50;       // of a pair whose rotation is sure enough to judge by
  int min_image_points = 20;       // seen by an image that is kept
  // Keeps each map from run to run; null: nothing is kept. For the defaults of all but `colmap`:
  // kept maps do not know of others.
  StageCache* cache = nullptr;
};

// The verified pairs that neither contradict the others nor show places which only look alike:
// KeepConsistentPairs(), DropLookAlikes(), DropPairsMissingTracks().
std::vector<VerifiedPair> BelievedPairs(const MapInput& input, std::span<const VerifiedPair> pairs,
                                        const SfmOptions& options);

struct SfmResult {
  std::vector<Reconstruction> maps;   // largest first, each in a frame and scale of its own
  std::vector<std::string> unmapped;  // names of frames that are in none of them
};

// Maps photographs whose poses are not known. Verified pairs that contradict the others, or that
// show places which only look alike, are put aside (BelievedPairs());
// COLMAP's mapper makes poses from the rest; under them frames are matched again, points
// triangulated and adjusted together with the poses (COLMAP's own result can be bent), images
// that contradict their pairs dropped, missed frames registered, and points triangulated anew.
// Frames that are left make maps of their own where they can. Poses in `input` are not used.
//   candidates  pairs of frames that may show the same: SelectPairs()
//   pairs       those of them that VerifyPairs() kept
// `stages` opens a stage of progress; may be empty. Throws ToolError where there is no map at
// all, and as RunColmapMapper() does.
SfmResult MapPhotographs(const MapInput& input, std::span<const FramePair> candidates,
                         std::span<const VerifiedPair> pairs, const SfmOptions& options, int jobs,
                         const std::function<Progress(const std::string& stage)>& stages = {});

}  // namespace viewfix
