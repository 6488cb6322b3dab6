// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "models/model_writer.h"

namespace viewfix {

// The maps' part of KeepUnchanged() (base_model.h). Returns whether a map's frame had to grow.
//   base_keyframe  [model's keyframes] the base's that each one is; -1: none
bool KeepMaps(const ModelData& base, std::span<const int> base_keyframe, bool poses_given,
              ModelData& model);

}  // namespace viewfix
