// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "firmware_tools/mapping/reconstruction.h"
#include "firmware_tools/mapping/two_view.h"

namespace viewfix {

// Key points that matches link from frame to frame: each with at least two, at most one a
// frame, by frame. Links are taken by the distance of their descriptors, nearest first; one
// that would bring two key points of a frame together is left out. image_idx: the frame.
std::vector<std::vector<Observation>> BuildTracks(const MapInput& input,
                                                  std::span<const VerifiedPair> pairs);

}  // namespace viewfix
