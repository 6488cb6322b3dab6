// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "models/model_view.h"

namespace viewfix {

// What the live page draws a place on, as a JSON object:
//   model         its hash
//   metric        the first map's units are metres
//   floor_plan    null, or {width, height, site_from_pixel: [a, b, tx, ty]} (models/viewfix.fbs)
//   points        [[x, y], ...] of the first map from above, a few thousand at most
//   keyframes     [{x, y, dx, dy, location}, ...] where photographs were taken, and which way they
//   look locations     the names
std::string MapJson(const ModelView& model);

// The map that a keyframe's pose is of: its landmarks', else the first.
int MapOfKeyframe(const ModelView& model, int keyframe_idx);

}  // namespace viewfix
