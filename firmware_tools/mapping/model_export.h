// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <vector>

#include "firmware_tools/mapping/export.h"
#include "firmware_tools/mapping/reconstruction.h"
#include "models/model_view.h"

namespace viewfix {

// The maps of a model, in its order: landmarks as points, keyframes that have a pose as images,
// by name.
// Models hold no key points: an image's are where the model's camera sees the keyframe's
// landmarks, so that all errors are 0; landmarks out of its sight are left out. A keyframe that
// sees no landmark is left out unless there is one map only.
std::vector<Reconstruction> MapsOfModel(const ModelView& model);

// Export() of each of a model's maps; returns what was written. Where there are several, map i
// goes to the folder PATH/i (kColmap), or to NAME-i.EXT beside PATH = NAME.EXT. Throws as
// Export(). A model without landmarks gives nothing.
std::vector<std::filesystem::path> ExportModel(const ModelView& model, ExportFormat format,
                                               const std::filesystem::path& path);

}  // namespace viewfix
