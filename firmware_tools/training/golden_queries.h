// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "firmware_tools/training/feature_store.h"
#include "models/model_writer.h"

namespace viewfix {

// Puts into a model that is otherwise complete the features of a few training images, and what the
// localizer says of them: boards try these before they take the model (platform/store/golden.h).
// None where no image is localized. Those of `base` (null: none) come first, if they are of the
// same place still.
void AddGoldenQueries(const FeatureStore& features, const ModelData* base, ModelData& model);

}  // namespace viewfix
