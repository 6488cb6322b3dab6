// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/site_map.h"

#include <map>

#include "firmware_tools/mapping/pair_selection.h"
#include "firmware_tools/mapping/sfm.h"

namespace viewfix {
namespace {

Progress Begin(const std::function<Progress(const std::string&)>& stages, const char* stage) {
  return stages ? stages(stage) : Progress();
}

// Rows and columns `kept` of a square matrix.
Eigen::MatrixXf Submatrix(const Eigen::MatrixXf& all, const std::vector<int>& kept) {
  const auto n = static_cast<Eigen::Index>(kept.size());
  Eigen::MatrixXf part(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) part(i, j) = all(kept[i], kept[j]);
  }
  return part;
}

// Positions in image_idxs of what can be mapped.
std::vector<int> Mappable(const ImageSet& set, const FeatureStore& features,
                          std::span<const int> image_idxs, MapSource source) {
  std::vector<int> kept;
  for (int i = 0; i < static_cast<int>(image_idxs.size()); ++i) {
    const ImageRecord& image = set.images[image_idxs[i]];
    if (features.images[image_idxs[i]].keypoints.empty()) continue;
    if (source == MapSource::kPoses && (!image.pose || image.camera_idx < 0)) continue;
    kept.push_back(i);
  }
  return kept;
}

std::string Count(std::size_t n, const char* what) {
  std::string text = std::to_string(n);
  text += what;
  return text;
}

SiteMap Reconstruct(const MapInput& input, std::span<const FramePair> candidates,
                    std::span<const VerifiedPair> pairs, const SiteMapOptions& options,
                    const std::function<Progress(const std::string&)>& stages) {
  SiteMap site;
  if (options.source == MapSource::kPoses) {
    site.maps.push_back(TriangulateWithPoses(input, pairs, {}, options.jobs,
                                             Begin(stages, "triangulation")));
    site.metric = true;
    return site;
  }
  SfmOptions sfm;
  sfm.colmap.work_folder = options.work_folder;
  sfm.colmap.seed = options.seed;
  sfm.colmap.refine_focal = options.refine_focal;
  sfm.triangulate.adjust.focal = options.refine_focal;
  SfmResult result = MapPhotographs(input, candidates, pairs, sfm, options.jobs, stages);
  site.maps = std::move(result.maps);
  if (site.maps.size() > 1) {
    site.warnings.push_back(Count(site.maps.size(), " maps that are not connected with each other"));
  }
  if (!result.unmapped.empty()) {
    site.warnings.push_back(Count(result.unmapped.size(), " images are in no map, the first: ") +
                            result.unmapped.front());
  }
  return site;
}

}  // namespace

SiteMap MapSite(const ImageSet& set, const FeatureStore& features, std::span<const int> image_idxs,
                const Eigen::MatrixXf& similarity, const SiteMapOptions& options,
                const std::function<Progress(const std::string& stage)>& stages) {
  if (options.source == MapSource::kNone) return {};
  const std::vector<int> kept = Mappable(set, features, image_idxs, options.source);
  if (kept.size() < 2) return {};
  std::vector<int> images;
  for (const int i : kept) images.push_back(image_idxs[i]);
  const MapInput input = MakeMapInput(set, features, images);
  const auto candidates = SelectPairs(input, Submatrix(similarity, kept));
  TwoViewOptions two_view;
  two_view.seed = options.seed;
  MapInput without_poses = input;
  const bool known = options.source == MapSource::kPoses;
  if (!known) {
    for (MapFrame& frame : without_poses.frames) frame.cam_from_world.reset();
  }
  const MapInput& used = known ? input : without_poses;
  const auto pairs =
      VerifyPairs(used, candidates, two_view, options.jobs, Begin(stages, "matching"));
  return Reconstruct(used, candidates, pairs, options, stages);
}

ImageSet WithMappedPoses(const ImageSet& set, const SiteMap& site) {
  ImageSet mapped = set;
  std::map<std::string, Rigid3> cam_from_world;
  if (!site.maps.empty()) {
    for (const MapImage& image : site.maps.front().images) {
      cam_from_world[image.name] = image.cam_from_world;
    }
  }
  for (ImageRecord& image : mapped.images) {
    image.pose.reset();
    const auto found = cam_from_world.find(image.path);
    if (found == cam_from_world.end()) continue;
    const Rigid3 world_from_cam = Inverse(found->second);
    image.pose = Pose{world_from_cam.rotation, world_from_cam.translation};
  }
  return mapped;
}

}  // namespace viewfix
