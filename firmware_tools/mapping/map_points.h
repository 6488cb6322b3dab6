// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <set>
#include <span>
#include <string>
#include <vector>

#include "firmware_tools/mapping/point_solver.h"
#include "firmware_tools/mapping/reconstruction.h"

namespace viewfix {

// What observations of a map see. max_error_px: of an image of 640 pixels a side.
std::vector<PointView> ViewsOf(const Reconstruction& map, std::span<const Observation> track,
                               double max_error_px);

// Puts a track in order of images.
void SortTrack(MapPoint& point);

// Makes MapImage::point_idx agree with the tracks.
void RenumberPoints(Reconstruction& map);

// The map without some images, by name; points that fewer than two others see go too.
Reconstruction Without(const Reconstruction& map, const std::set<std::string>& names);

// Refines every point under the poses as they are, drops observations farther than max_error_px
// (of an image of 640 pixels a side), and points with fewer than two observations or rays that
// meet at less than min_angle_deg. Returns how many observations were dropped. `jobs` threads
// (0: all cores); the result does not depend on it.
int RefineAndFilter(Reconstruction& map, double max_error_px, double min_angle_deg, int jobs);

}  // namespace viewfix
