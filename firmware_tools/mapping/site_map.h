// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "firmware_tools/common/parallel.h"
#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/mapping/reconstruction.h"
#include "firmware_tools/mapping/site_frame.h"
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
  // How sure kPoses are, units of the set: they are adjusted together with the landmarks and keep
  // the set's frame. 0: they are right as they are.
  double pose_sigma = 0;
  std::filesystem::path work_folder;  // COLMAP's, kept
  StageCache* cache = nullptr;        // keeps what pairs of images gave; null: nothing is kept
  SiteControls controls;              // none: maps keep the frame that they come in
  int seed = 1;
  int jobs = 0;  // 0: all cores
};

struct SiteMap {
  std::vector<Reconstruction> maps;      // largest first; none: nothing to map
  bool metric = false;                   // units are metres, at least the largest map's
  std::vector<MapPlacement> placements;  // [maps]
  Similarity site_from_set;  // where the set's own poses are: not identity if controls moved them
  std::vector<std::string> notes;  // for people: how well the controls fit
  std::vector<std::string> warnings;
};

// Maps the images `image_idxs` of a set: pairs chosen by order and likeness, verified, and
// triangulated under given poses, or poses made by structure from motion first. Image and
// keypoint indices of a map are those of its own images; names are the set's paths. Maps then go
// to the site's frame by its control points and tags (PlaceMaps()); without them, those of
// kColmap are turned so that z is up, where the cameras tell. Cameras that the set does not give
// are EXIF's or, at worst, guesses, whose focal lengths are refined; with kPoses, images without
// a pose or a camera of the set are left out, which a warning tells; fewer than two: no map.
//   similarity [n, n] dot products of the images' histograms, in the order of image_idxs
// Throws ToolError: COLMAP fails, the controls do not fit, or there is no map to fit them to.
SiteMap MapSite(const ImageSet& set, const FeatureStore& features, std::span<const int> image_idxs,
                const Eigen::MatrixXf& similarity, const SiteMapOptions& options,
                const std::function<Progress(const std::string& stage)>& stages);

// Why images that have poses are left out of a kPoses map, naming the file that would help; empty:
// each has a camera of the set.
std::string MissingCalibration(const ImageSet& set, std::span<const int> image_idxs);

// The set with the poses of a site's maps in place of its own; images in none have no pose. Taken
// are the largest map's, and those of all that are in the site's frame if it is too: the others
// have frames of reference of their own.
ImageSet WithMappedPoses(const ImageSet& set, const SiteMap& site);

// What a model's record says of its maps: sizes, how each was placed, residuals of the controls.
nlohmann::ordered_json MapsAsJson(const SiteMap& site);

// SiteMap::site_from_set, of what MapsAsJson() wrote; identity where it is not there.
Similarity SiteFromSet(const nlohmann::ordered_json& maps);

}  // namespace viewfix
