// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "firmware_tools/mapping/map_input.h"
#include "firmware_tools/mapping/two_view.h"

namespace viewfix {

struct PairOptions {
  int window = 8;       // frames of one capture at most this far apart in order
  int neighbours = 10;  // most similar other frames, for each frame
  int reach = 2;        // of PairsBeside(): frames in order from either of a pair
  // Where both poses are known, a pair found by similarity must be able to show the same.
  double max_heading_deg = 90;  // between the optical axes
  double max_distance = 20;     // between the cameras, world units
};

// Pairs of frames worth matching, ascending, each once.
//   similarity [frames, frames], greater is more alike: the dot products of Hellinger
//   histograms (GramMatrix)
std::vector<FramePair> SelectPairs(const MapInput& input, const Eigen::MatrixXf& similarity,
                                   const PairOptions& options = {});

// More candidates beside pairs that were verified: frames of other captures, or too far apart in
// order for SelectPairs(), that a map meets at again are neighbours of others that do, and a loop
// that a few pairs close well is one that a map can bend at. At most half as many as were tried,
// beside pairs of most matches first; ascending, none of `tried`.
std::vector<FramePair> PairsBeside(const MapInput& input, std::span<const VerifiedPair> verified,
                                   std::span<const FramePair> tried,
                                   const PairOptions& options = {});

}  // namespace viewfix
