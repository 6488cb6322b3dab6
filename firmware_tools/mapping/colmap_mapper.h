// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "firmware_tools/mapping/map_input.h"
#include "firmware_tools/mapping/reconstruction.h"
#include "firmware_tools/mapping/two_view.h"

namespace viewfix {

struct ColmapOptions {
  std::string program = "colmap";     // found in PATH if it has no slash
  std::filesystem::path work_folder;  // made if missing; kept, and used again
  int seed = 1;
  bool refine_focal = false;
  int max_trials = 3;  // initial pairs tried before the best model is taken
  // A model that needs no other trial: share of the frames that it registers, and of the loops'
  // matches that it contradicts: a loop left open shows nowhere else.
  double min_registered = 0.9;
  double max_open = 0.025;
};

// The poses that COLMAP's mapper gives one connected set of frames.
struct ColmapTrial {
  FramePair initial;  // that the mapper began with
  Reconstruction map;
  int registered = 0;
  double open_share = 0;  // OpenLoopShare()
};

// Pairs to begin a reconstruction with, best first: many matches and wide angles, no frame
// in two of them.
std::vector<FramePair> ChooseInitialPairs(std::span<const VerifiedPair> pairs, int max_pairs);

// Runs `colmap mapper` on the frames and verified matches, headless and with a fixed seed: from a
// few initial pairs (its own choice may bend a map without a sign), until a model registers
// enough frames and closes the loops that the verified pairs make; returns the best. The folder
// keeps database, models and log; a model that is complete there, of the same input, is not
// computed again. Frames without features are left out. None: no initial pair led to a model.
// `progress`: frames registered of all. Throws ToolError: the program is missing; it failed (its
// log's last lines are quoted).
std::optional<ColmapTrial> RunColmapMapper(const MapInput& input,
                                           std::span<const VerifiedPair> pairs,
                                           const ColmapOptions& options, int jobs,
                                           const Progress& progress = {});

// Share of the matches that a map contradicts, of those between images far apart in order or of
// different captures: where a walk meets itself again. Images are known by their names. 0 where
// there is no loop.
double OpenLoopShare(const MapInput& input, std::span<const VerifiedPair> pairs,
                     const Reconstruction& map);

}  // namespace viewfix
