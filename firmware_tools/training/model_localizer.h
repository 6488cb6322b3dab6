// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "engine/localizer.h"

namespace viewfix {

// The engine over a model, with the features that the model was made of; those that only the
// laptop has (SIFT) too. Throws ToolError where the engine refuses.
Localizer MakeModelLocalizer(const ModelView& model, const LocalizerOptions& options);

}  // namespace viewfix
