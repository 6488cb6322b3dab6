// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/model_localizer.h"

#include "firmware_tools/training/feature_store.h"

namespace viewfix {

FeatureOptions FeatureOptionsOf(const ModelView& model) {
  const ModelFeatures& f = model.features();
  return {.type = static_cast<FeatureType>(f.type),
          .max_image_side = f.max_image_side,
          .max_features = f.max_features,
          .upright = f.upright,
          .threshold = f.threshold};
}

Localizer MakeModelLocalizer(const ModelView& model, const LocalizerOptions& options) {
  auto extractor = MakeExtractor(FeatureOptionsOf(model));
  auto localizer = Localizer::Create(model, options, std::move(extractor));
  if (!localizer.ok()) throw ToolError(localizer.status().text());
  return std::move(*localizer);
}

}  // namespace viewfix
