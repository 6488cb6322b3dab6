// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "firmware_tools/mapping/map_input.h"

namespace viewfix {

struct PairOptions {
  int window = 8;       // frames of one capture at most this far apart in order
  int neighbours = 10;  // most similar other frames, for each frame
  // Where both poses are known, a pair found by similarity must be able to show the same.
  double max_heading_deg = 90;  // between the optical axes
  double max_distance = 20;     // between the cameras, world units
};

// Pairs of frames worth matching, ascending, each once.
//   similarity [frames, frames], greater is more alike: the dot products of Hellinger
//   histograms (GramMatrix)
std::vector<FramePair> SelectPairs(const MapInput& input, const Eigen::MatrixXf& similarity,
                                   const PairOptions& options = {});

}  // namespace viewfix
