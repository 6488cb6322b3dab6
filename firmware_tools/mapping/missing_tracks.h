// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "firmware_tools/mapping/two_view.h"

namespace viewfix {

struct MissingTrackOptions {
  int window = 8;       // frames of one capture at most this far apart in order are neighbours
  int min_length = 6;   // key points of a track that is sure to belong to its place
  int min_chances = 6;  // to be seen by the other stretch's frames, before a track is missing there
  // Greatest share of patches that are holes between two stretches, walks or groups of walks that
  // show the same place, and how many patches it takes to say so. The museum, seed 1: of two show
  // windows that share half of their goods each pair of stretches has 0.06 or more, of a room seen
  // again 99 % have less.
  double max_holes = 0.05;
  int min_patches = 20;
  // Pairs do not join groups of so many frames, nor walks, if they are fewer than min_links: chance
  // gives a few.
  int min_frames = 10;
  int min_links = 12;
};

// Tells two places that share things from one place seen again: between look-alikes, whatever is
// not shared leaves holes in what matches. Only pairs of different walks are asked: what one walk
// shares with itself is judged by its loops (pair_consistency.h), and a walk that blurs breaks its
// tracks. Key points that the frames of one stretch of a walk see
// again and again are followed as tracks; those that lie among the matches with frames of another
// stretch, at a scale that can be found there, should be seen there once in a few chances. In one
// place seen again a few tracks here and there are missed; between look-alikes most tracks of
// whole patches of the image are. Pairs between stretches with too many such holes are dropped,
// and all that two walks (captures), or two groups of walks that show one place each, share, if it
// has too many holes as a whole. Then pairs that are few, if they alone join what other pairs do
// not: one door, or poster, can hang in many rooms. Order is kept.
std::vector<VerifiedPair> DropPairsMissingTracks(const MapInput& input,
                                                 std::span<const VerifiedPair> pairs,
                                                 const MissingTrackOptions& options = {});

}  // namespace viewfix
