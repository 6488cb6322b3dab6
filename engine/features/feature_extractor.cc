// SPDX-License-Identifier: BSD-3-Clause
#include "engine/features/feature_extractor.h"

#include <string_view>

#ifdef VIEWFIX_HAVE_SURF
#include "engine/features/surf.h"
#endif

namespace viewfix {

const char* FeatureTypeName(FeatureType type) {
  switch (type) {
    case FeatureType::kSurf:
      return "surf";
    case FeatureType::kSift:
      return "sift";
    case FeatureType::kColorSurf:
      return "color-surf";
    case FeatureType::kSurfChroma:
      return "surf-chroma";
  }
  return "unknown";
}

Status FeatureOptions::Validate() const {
  if (std::string_view(FeatureTypeName(type)) == "unknown") {
    return Status(StatusCode::kInvalidArgument, "unknown feature type");
  }
  if (max_image_side < 64 || max_image_side > 4096) {
    return Status(StatusCode::kInvalidArgument, "the longest image side must be 64..4096 pixels");
  }
  if (max_features < 16 || max_features > 8192) {
    return Status(StatusCode::kInvalidArgument, "the number of features must be 16..8192");
  }
  if (!(threshold >= 0 && threshold <= 1)) {
    return Status(StatusCode::kInvalidArgument, "the feature threshold must be 0..1");
  }
  return {};
}

Status CheckExtractArguments(const FeatureExtractor& extractor, const FeatureOptions& options,
                             const ImageView& image, const FeatureSet& features) {
  if (image.empty() || image.row_bytes < image.width) {
    return Status(StatusCode::kInvalidArgument, "no image to find features in");
  }
  if (image.width > options.max_image_side || image.height > options.max_image_side) {
    return Status(StatusCode::kInvalidArgument,
                  "the image is larger than the features' longest side");
  }
  if (features.dim() != extractor.descriptor_dim() || features.capacity() < options.max_features) {
    return Status(StatusCode::kInvalidArgument, "the feature set has another shape");
  }
  return {};
}

Result<std::unique_ptr<FeatureExtractor>> CreateFeatureExtractor(const FeatureOptions& options) {
  const Status status = options.Validate();
  if (!status.ok()) return status;
#ifdef VIEWFIX_HAVE_SURF
  if (options.type != FeatureType::kSift) {
    return std::unique_ptr<FeatureExtractor>(std::make_unique<Surf>(options));
  }
#endif
  return Status(StatusCode::kUnsupported, "this build cannot compute the feature type asked for");
}

}  // namespace viewfix
