// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "engine/geometry/camera.h"
#include "engine/geometry/rigid3.h"
#include "models/model_writer.h"

namespace viewfix {

// One photograph, and TinyModelData() with a landmark at each of its features, at random depths
// along their rays: where the photograph was taken is known exactly. Even keyframes see the
// landmarks, a part each.
struct LandmarkSite {
  int width = 320;  // the model's own side: features are found in the pixels as they are
  int height = 240;
  std::vector<std::uint8_t> pixels;
  Camera camera;
  Rigid3 world_from_cam;
  ModelData data;
};

LandmarkSite MakeLandmarkSite();

}  // namespace viewfix
