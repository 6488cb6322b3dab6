// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "firmware_tools/mapping/adjust.h"
#include "firmware_tools/mapping/map_input.h"
#include "firmware_tools/mapping/reconstruction.h"
#include "firmware_tools/mapping/track_completion.h"
#include "firmware_tools/mapping/two_view.h"

namespace viewfix {

struct TriangulateOptions {
  double max_error_px = 3.5;            // reprojection, of an image of 640 pixels a side
  double min_angle_deg = 1.5;           // between the widest rays of a point
  double max_descriptor_distance = 50;  // CompletionOptions
  int completion_rounds = 2;            // of looking for points where they must be seen
  int adjustments = 0;  // joint adjustments of poses and points, each with a completion after it
  AdjustOptions adjust{.poses = true};
};

// The map of the frames whose pose is given: matches linked into tracks, points triangulated
// robustly (a track may give several), completed by looking for them in neighbouring frames,
// and, where asked for, adjusted together with the poses. Images are the frames with a pose, in
// order, and points are seen at least twice. Throws ToolError if fewer than two frames have a
// pose, or nothing could be triangulated. The same whatever `jobs` is (0: all cores).
Reconstruction TriangulateWithPoses(const MapInput& input, std::span<const VerifiedPair> pairs,
                                    const TriangulateOptions& options, int jobs,
                                    const Progress& progress = {});

// What the figures of a map are.
struct MapSummary {
  int images = 0;
  int points = 0;
  int observations = 0;
  double mean_track = 0;
  double mean_error_px = 0;  // over observations
};

MapSummary Summarize(const Reconstruction& map);

}  // namespace viewfix
