// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>

#include "firmware_tools/common/parallel.h"

namespace viewfix {

struct SimulateOptions {
  std::filesystem::path out;  // made if absent; its parent must exist
  std::uint64_t seed = 1;
  // Images of each (location, view), 2..20. Below 20 no walk is rendered and fewer other
  // rooms: a small set for tests.
  int images_per_view = 20;
  int jobs = 0;  // 0: all cores; the result does not depend on it
};

// Renders the built-in museum as an image set with exact labels, poses and calibration:
// 10 locations x 3 views x 20 distances, of which 3 a view are test, and a walk through all
// of it, 1374 images of 640 x 480. OUT/distractors is a set of its own: rooms of the same
// building that belong to no location. Another seed is another building: other sizes, plans and
// furniture of the rooms, other materials, signs and pictures. Light and white balance differ
// between training and test. OUT/control.csv says where some of the training images were taken (for
// `train --control`). images.csv is written last, so a folder that has one is complete.
// Throws ToolError.
void SimulateMuseum(const SimulateOptions& options, const Progress& progress);

}  // namespace viewfix
