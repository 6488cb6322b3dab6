// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>

#include "engine/base/cpu_path.h"
#include "engine/features/chroma_contrast.h"
#include "engine/features/fast_hessian.h"
#include "engine/features/feature_extractor.h"
#include "engine/features/grid_selector.h"
#include "engine/image/integral_image.h"

namespace viewfix {

// Raised whenever the same pixels and options give other features.
inline constexpr std::uint32_t kSurfVersion = 1;

// Speeded-up robust features with 64 dimensions [1]: fast-Hessian blobs, the best
// by grid, oriented (or upright) and described. The image is mirrored at its
// edges, so points are found and described up to the edge. Of type kColorSurf, a descriptor has
// kChromaDim numbers more (chroma_contrast.h); of type kSurfChroma they stand beside it. Key points
// are the same.
// [1] H. Bay, A. Ess, T. Tuytelaars, L. Van Gool, Speeded-Up Robust Features,
//     CVIU 110 (2008).
class Surf final : public FeatureExtractor {
 public:
  // `options` valid, of any type but kSift. Allocates all memory that Extract() uses:
  // about 4 (max_image_side + 200)^2 bytes for the integral image, and half as much for chroma.
  explicit Surf(const FeatureOptions& options, CpuPath path = BestCpuPath());

  int descriptor_dim() const override;
  std::uint32_t version() const override { return kSurfVersion; }
  Status Extract(const ImageView& image, FeatureSet& features) override;

 private:
  FeatureOptions options_;
  CpuPath path_;
  IntegralImage integral_;
  FastHessian detector_;
  GridSelector selector_;
  std::optional<ChromaContrast> chroma_;  // where the type sees colours
};

}  // namespace viewfix
