// SPDX-License-Identifier: BSD-3-Clause
#include "engine/features/surf.h"

#include "engine/features/surf_descriptor.h"
#include "engine/features/surf_orientation.h"

namespace viewfix {

Surf::Surf(const FeatureOptions& options, CpuPath path)
    : options_(options),
      path_(path),
      integral_(options.max_image_side, FastHessian::kReach),
      detector_(options.max_image_side, path),
      selector_(options.max_image_side, options.max_features) {
  if (options.type == FeatureType::kColorSurf) chroma_.emplace(options.max_image_side, path);
}

int Surf::descriptor_dim() const { return kSurfDim + (chroma_ ? kChromaDim : 0); }

Status Surf::Extract(const ImageView& image, FeatureSet& features) {
  const Status status = CheckExtractArguments(*this, options_, image, features);
  if (!status.ok()) return status;

  integral_.Compute(image);
  selector_.Start(image.width, image.height);
  detector_.Detect(integral_, options_.threshold, selector_);
  selector_.Select(features);
  if (chroma_) chroma_->Start(image, integral_);
  for (int i = 0; i < features.size(); ++i) {
    Keypoint& keypoint = features.mutable_keypoint(i);
    if (!options_.upright) AssignOrientation(integral_, keypoint, path_);
    const auto descriptor = features.mutable_descriptor(i);
    DescribeSurf(integral_, keypoint, descriptor.first<kSurfDim>(), path_);
    if (chroma_) chroma_->Describe(keypoint, descriptor.subspan<kSurfDim, kChromaDim>());
  }
  return {};
}

}  // namespace viewfix
