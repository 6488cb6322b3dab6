// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/localizer.h"
#include "models/model_view.h"

namespace viewfix {

// The features of one image, as ModelGolden stores them.
struct GoldenFeatures {
  int width = 0;  // pixels of the image that they were found in
  int height = 0;
  std::span<const float> keypoints;  // [features, 5]
  std::span<const std::int8_t> laplacian_sign;
  std::span<const std::int8_t> descriptors;  // [features, dim]
};

// The engine without its eyes: localizes features that were found before.
class GoldenLocalizer {
 public:
  // `model` is borrowed. Errors: those of Localizer::Create.
  static Result<GoldenLocalizer> Create(const ModelView& model);
  Result<Fix> Localize(const GoldenFeatures& features);

 private:
  class Extractor;
  GoldenLocalizer(Localizer localizer, Extractor* extractor);

  Localizer localizer_;
  Extractor* extractor_;  // the localizer's own
  std::vector<std::uint8_t> blank_;
};

GoldenFeatures GoldenQueryAt(const ModelView& model, int query_idx);

// Whether this build answers the model's golden queries as its trainer did: the same location and
// view, the pose within 5 cm (or units of its map) and 1 degree. kUnsupported: it does not, or the
// model's features are not this build's. A model without queries passes.
Status SelfTest(const ModelView& model);

}  // namespace viewfix
