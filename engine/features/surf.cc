// SPDX-License-Identifier: BSD-3-Clause
#include "engine/features/surf.h"

#include <algorithm>
#include <cstdlib>

#include "engine/features/surf_descriptor.h"
#include "engine/features/surf_orientation.h"

namespace viewfix {
namespace {

// A level or two of chroma are noise.
constexpr int kMostOfGrey = 10;

}  // namespace

Surf::Surf(const FeatureOptions& options, CpuPath path)
    : options_(options),
      path_(path),
      integral_(options.max_image_side, FastHessian::kReach),
      detector_(options.max_image_side, path),
      selector_(options.max_image_side, options.max_features) {
  if (SeesColours(options.type)) chroma_.emplace(options.max_image_side, path);
}

int Surf::descriptor_dim() const {
  return kSurfDim + (options_.type == FeatureType::kColorSurf ? kChromaDim : 0);
}

Status Surf::Extract(const ImageView& image, FeatureSet& features) {
  const Status status = CheckExtractArguments(*this, options_, image, features);
  if (!status.ok()) return status;

  integral_.Compute(image);
  selector_.Start(image.width, image.height);
  detector_.Detect(integral_, options_.threshold, selector_);
  selector_.Select(features);
  const bool beside = options_.type == FeatureType::kSurfChroma;
  if (chroma_) chroma_->Start(image, integral_);
  for (int i = 0; i < features.size(); ++i) {
    Keypoint& keypoint = features.mutable_keypoint(i);
    if (!options_.upright) AssignOrientation(integral_, keypoint, path_);
    const auto descriptor = features.mutable_descriptor(i);
    DescribeSurf(integral_, keypoint, descriptor.first<kSurfDim>(), path_);
    if (!chroma_) continue;
    chroma_->Describe(
        keypoint, beside ? features.mutable_chroma(i) : descriptor.subspan<kSurfDim, kChromaDim>());
  }
  // Not of a grey picture in a colour format: it has contrasts of none.
  features.set_has_chroma(beside &&
                          std::ranges::any_of(features.chroma(), [](std::int8_t contrast) {
                            return std::abs(contrast) > kMostOfGrey;
                          }));
  return {};
}

}  // namespace viewfix
