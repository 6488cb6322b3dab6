// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>

#include "engine/features/feature_extractor.h"

namespace viewfix {

// --features, --max-features, --max-side and --upright, shared by `train` and `check`.
void AddFeatureFlags(CLI::App& command, FeatureOptions& options);

}  // namespace viewfix
