// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>
#include <vector>

#include "models/model_writer.h"

namespace viewfix {

// A model that another one is to differ from as little as it can (`train --base`).
struct BaseModel {
  ModelData data;
  std::string id;  // as output names it
};

// Throws ToolError: not a model.
BaseModel ReadBaseModel(std::span<const std::uint8_t> file, const std::string& name);

// What was done with the locations, by name.
struct BaseReport {
  std::vector<std::string> kept;
  std::vector<std::string> trained;  // changed, or not in the base
  std::vector<std::string> removed;
  bool frame_grew =
      false;  // new landmarks lay beyond the base's map: all positions are rounded anew
};

// Gives `model`, which was trained with the base's vocabulary and codebook, the base's sections
// wherever a location is unchanged: the same photographs by name, with the same words and views
// and, if `poses_given`, the same poses. These keep their weights, poses, landmarks and details to
// the bit. Maps keep the base's frames of reference, and landmarks their numbers but for as many as
// it takes to fill the holes of those that went; maps that were not made under given poses are
// moved to where the base's photographs stand. Throws ToolError: the base's camera is another one.
BaseReport KeepUnchanged(const BaseModel& base, bool poses_given, ModelData& model);

}  // namespace viewfix
