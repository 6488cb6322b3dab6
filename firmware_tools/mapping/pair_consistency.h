// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "firmware_tools/mapping/two_view.h"

namespace viewfix {

struct ConsistencyOptions {
  // Frames of one capture at most this far apart in order are neighbours: they are likely to
  // show the same, and need less evidence.
  int window = 8;
  double max_loop_error_deg = 6;  // a loop of three rotations that agree
  // Key points followed around a loop that return to themselves: so many agree whatever the
  // rotations say, which a few matches of a narrow view leave uncertain.
  int min_closed = 6;
  double min_contradiction_deg = 15;  // a loop that does not
  int min_support = 2;                // loops that a pair of frames far apart must agree with
  int min_lone_inliers = 60;          // enough matches for neighbours that are in no loop
  // Matches of a pair far apart must be distinctive: the sum of their weights, where a match
  // counts 1 / (1 + other places its key points match), reaches this.
  double min_distinctive = 12;
};

// Which pairs to believe, where many were verified one by one: wrong ones (repeated things,
// chance) contradict the others. A loop of three pairs is consistent if its rotations cancel or
// enough key points followed around it return to themselves.
// Pairs that more loops contradict than support are dropped, worst first; then pairs of frames
// far apart (in order, or of other captures) that too few loops support, or whose matches are of
// things that occur in many places. Order is kept.
std::vector<VerifiedPair> KeepConsistentPairs(const MapInput& input,
                                              std::span<const VerifiedPair> pairs,
                                              const ConsistencyOptions& options = {});

}  // namespace viewfix
