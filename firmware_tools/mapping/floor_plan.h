// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

namespace viewfix {

// A plan of the site as a picture, and where its pixels are.
struct FloorPlan {
  std::vector<std::uint8_t> picture;  // a PNG or JPEG file
  int width = 0;                      // pixels
  int height = 0;
  // a b tx ty, pixel centres at integers, y of the picture down and that of the site up:
  //   x = a px + b py + tx,  y = b px - a py + ty  [metres]
  std::array<double, 4> site_from_pixel{};
  double rms_metres = 0;  // what is left of the points' errors
};

// Reads a plan and aligns it by a CSV px,py,x,y of two points or more: pixels of the picture and
// their places on the site. A picture of more than kMaxFloorPlanBytes is shrunk until it is not.
// Throws ToolError naming the file: not a PNG or JPEG, too few or equal points, points that do
// not fit a similarity to half a metre (also where the plan is mirrored).
FloorPlan ReadFloorPlan(const std::filesystem::path& picture_file,
                        const std::filesystem::path& align_file);

}  // namespace viewfix
