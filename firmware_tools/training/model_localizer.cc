// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/model_localizer.h"

#include "firmware_tools/training/feature_store.h"

namespace viewfix {

Localizer MakeModelLocalizer(const ModelView& model, const LocalizerOptions& options) {
  const ModelFeatures& f = model.features();
  auto extractor = MakeExtractor({.type = static_cast<FeatureType>(f.type),
                                  .max_image_side = f.max_image_side,
                                  .max_features = f.max_features,
                                  .upright = f.upright,
                                  .threshold = f.threshold});
  auto localizer = Localizer::Create(model, options, std::move(extractor));
  if (!localizer.ok()) throw ToolError(localizer.status().text());
  return std::move(*localizer);
}

}  // namespace viewfix
