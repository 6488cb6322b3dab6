// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>

#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/mapping/site_map.h"
#include "firmware_tools/training/feature_store.h"
#include "models/model_writer.h"

namespace viewfix {

struct ModelMapOptions {
  // Landmarks that every keyframe keeps where it has them: those seen by most keyframes, spread
  // over its image. The knee of accuracy against bytes.
  int landmarks_per_keyframe = 400;
  int min_track = 2;        // key points that saw a landmark, >= 2
  int jobs = 0;             // 0: all cores; the result does not depend on it
  double max_error_px = 2;  // mean reprojection error of a landmark that is kept
};

// Puts a site's maps into a model whose keyframes are there already: chooses landmarks so that
// every keyframe sees enough of them all over its image (a greedy cover, longest tracks first),
// averages the descriptors of each, quantizes positions, and gives keyframes their maps' poses.
//   keyframe_image_idxs [keyframes] into ImageSet::images
void AddMapToModel(const SiteMap& site, const ImageSet& set, const FeatureStore& features,
                   std::span<const int> keyframe_image_idxs, const ModelMapOptions& options,
                   ModelData& model);

}  // namespace viewfix
