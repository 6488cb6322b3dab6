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
      selector_(options.max_image_side, options.max_features) {}

int Surf::descriptor_dim() const { return kSurfDim; }

Status Surf::Extract(const ImageView& image, FeatureSet& features) {
  const Status status = CheckExtractArguments(*this, options_, image, features);
  if (!status.ok()) return status;

  integral_.Compute(image);
  selector_.Start(image.width, image.height);
  detector_.Detect(integral_, options_.threshold, selector_);
  selector_.Select(features);
  for (int i = 0; i < features.size(); ++i) {
    Keypoint& keypoint = features.mutable_keypoint(i);
    if (!options_.upright) AssignOrientation(integral_, keypoint, path_);
    DescribeSurf(integral_, keypoint, features.mutable_descriptor(i).first<kSurfDim>(), path_);
  }
  return {};
}

}  // namespace viewfix
