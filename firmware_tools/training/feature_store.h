// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "engine/features/feature_extractor.h"
#include "firmware_tools/common/parallel.h"
#include "firmware_tools/common/stage_cache.h"
#include "firmware_tools/dataset/image_set.h"
#include "platform/camera/jpeg_decoder.h"

namespace viewfix {

// What one photograph gave.
struct ImageFeatures {
  int width = 0;  // pixels of the image that features were found in (after shrinking)
  int height = 0;
  ExifInfo exif;
  std::vector<Keypoint> keypoints;
  std::vector<std::int8_t> descriptors;  // [keypoints, dim]
  std::vector<std::int8_t> chroma;       // [keypoints, kChromaDim], or none is known
};

// Features of an image set, by index into ImageSet::images.
struct FeatureStore {
  struct Failure {
    int image_idx = 0;
    std::string cause;  // names the file
  };
  FeatureOptions options;
  int dim = 0;
  std::uint32_t version = 0;
  std::vector<ImageFeatures> images;  // empty where failed or not asked for
  std::vector<Failure> failures;      // by image index
};

// Extractor of any type, the laptop-only ones included. Throws ToolError.
std::unique_ptr<FeatureExtractor> MakeExtractor(const FeatureOptions& options);

// Features of the images `image_idxs`, on `jobs` threads (0: all cores). An image that
// cannot be read, or gives fewer than 16 features, becomes a Failure.
//   cache  keeps the features of each image from run to run; null: nothing is kept
FeatureStore ExtractFeatures(const ImageSet& set, std::span<const int> image_idxs,
                             const FeatureOptions& options, int jobs, const Progress& progress,
                             StageCache* cache = nullptr);

}  // namespace viewfix
