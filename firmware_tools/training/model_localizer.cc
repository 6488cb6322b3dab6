// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/model_localizer.h"

#include "firmware_tools/training/feature_store.h"

namespace viewfix {

Localizer MakeModelLocalizer(const ModelView& model, const LocalizerOptions& options) {
  auto extractor = MakeExtractor(FeatureOptionsOf(model.features()));
  auto localizer = Localizer::Create(model, options, std::move(extractor));
  if (!localizer.ok()) throw ToolError(localizer.status().text());
  return std::move(*localizer);
}

}  // namespace viewfix
