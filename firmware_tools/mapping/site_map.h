// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "firmware_tools/common/parallel.h"
#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/mapping/reconstruction.h"
#include "firmware_tools/training/feature_store.h"

namespace viewfix {

// Where a site's map comes from.
enum class MapSource {
  kNone,
  kPoses,   // the poses that the set gives
  kColmap,  // structure from motion: poses that the set gives are not looked at
};

struct SiteMapOptions {
  MapSource source = MapSource::kPoses;
  std::filesystem::path work_folder;  // COLMAP's, kept
  bool refine_focal = false;          // calibrations are guesses
  int seed = 1;
  int jobs = 0;  // 0: all cores
};

struct SiteMap {
  std::vector<Reconstruction> maps;  // largest first; none: nothing to map
  bool metric = false;               // units are metres
  std::vector<std::string> warnings;
};

// Maps the images `image_idxs` of a set: pairs chosen by order and likeness, verified, and
// triangulated under given poses, or poses made by structure from motion first. Image and
// keypoint indices of a map are those of its own images; names are the set's paths.
//   similarity [n, n] dot products of the images' histograms, in the order of image_idxs
// With kPoses, images without a pose or a calibration are left out; fewer than two: no map.
// Throws ToolError: kColmap where a camera is not known, or COLMAP fails.
SiteMap MapSite(const ImageSet& set, const FeatureStore& features, std::span<const int> image_idxs,
                const Eigen::MatrixXf& similarity, const SiteMapOptions& options,
                const std::function<Progress(const std::string& stage)>& stages);

// The set with the poses of a site's maps in place of its own; images in none have no pose. Only
// the largest map's are taken: the others have frames of reference of their own.
ImageSet WithMappedPoses(const ImageSet& set, const SiteMap& site);

}  // namespace viewfix
