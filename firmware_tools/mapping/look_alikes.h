// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "firmware_tools/mapping/two_view.h"

namespace viewfix {

struct LookAlikeOptions {
  int window = 8;  // frames of one capture at most this far apart in order are neighbours
  // Least share of what should match that does, and how many cells it takes to say so.
  double min_share = 0.3;
  int min_cells = 24;
};

// Tells a place seen again from another that looks like it, by what does not match. Two equal
// show windows match well, but the walls around them do not; a place seen again matches all over.
// For a pair of frames far apart (in order, or of other captures) the matches' homography says
// where the cells of the one image lie in the other. Cells where both frames have key points that
// their own neighbours confirm should match. Pairs between the same two stretches of walks are
// judged together, since some of their frames see more of the surroundings than others: where too
// few of the cells match, all of them are dropped. Order is kept.
std::vector<VerifiedPair> DropLookAlikes(const MapInput& input, std::span<const VerifiedPair> pairs,
                                         const LookAlikeOptions& options = {});

}  // namespace viewfix
