// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "models/model_view.h"

namespace viewfix {

// The poses of viewfixd's JSON lines, in their order; lines without a pose are left out. Throws
// ToolError naming file and line: not JSON, or a pose that is none.
nlohmann::ordered_json ReadWalk(const std::string& file);

// Throws ToolError: a page could not be written, since three.js is missing.
void CheckMapLibraries(const std::string& what);

// Throws ToolError: the model has neither landmarks nor keyframes with a pose.
void CheckHasMap(const std::string& model_file, const ModelView& model);

// A model's maps as one HTML page that needs no other file: points, keyframes, location names and
// the floor plan, to fly through, and a walk of ReadWalk() as a moving camera. The model has
// landmarks, or keyframes with a pose.
std::string MapHtml(const std::string& title, const ModelView& model,
                    const nlohmann::ordered_json& walk);

}  // namespace viewfix
