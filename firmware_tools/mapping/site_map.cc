// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/site_map.h"

#include <algorithm>
#include <array>
#include <map>
#include <nlohmann/json.hpp>

#include "firmware_tools/mapping/pair_selection.h"
#include "firmware_tools/mapping/sfm.h"
#include "firmware_tools/mapping/triangulate.h"

namespace viewfix {
namespace {

Progress Begin(const std::function<Progress(const std::string&)>& stages, const char* stage) {
  return stages ? stages(stage) : Progress();
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

struct Matched {
  std::vector<FramePair> candidates;  // ascending, as are pairs
  std::vector<VerifiedPair> pairs;
};

Matched MatchFrames(const MapInput& input, const Eigen::MatrixXf& similarity, bool known,
                    const SiteMapOptions& options,
                    const std::function<Progress(const std::string&)>& stages) {
  TwoViewOptions two_view;
  two_view.seed = options.seed;
  const auto verify = [&](const std::vector<FramePair>& pairs, const char* stage) {
    return VerifyPairs(input, pairs, two_view, options.jobs, Begin(stages, stage), options.cache);
  };
  Matched matched{SelectPairs(input, similarity), {}};
  matched.pairs = verify(matched.candidates, "matching");
  if (known) return matched;
  const auto beside = PairsBeside(input, matched.pairs, matched.candidates);
  std::ranges::move(verify(beside, "matching loops"), std::back_inserter(matched.pairs));
  std::ranges::sort(matched.pairs, {}, &VerifiedPair::frames);
  std::ranges::copy(beside, std::back_inserter(matched.candidates));
  std::ranges::sort(matched.candidates);
  return matched;
}

SiteMap Reconstruct(const MapInput& input, const Matched& matched, const SiteMapOptions& options,
                    const std::function<Progress(const std::string&)>& stages) {
  SiteMap site;
  if (options.source == MapSource::kPoses) {
    TriangulateOptions triangulate;
    if (options.pose_sigma > 0) {
      triangulate.adjustments = 2;
      triangulate.adjust.position_sigma = options.pose_sigma;
    }
    site.maps.push_back(TriangulateWithPoses(input, matched.pairs, triangulate, options.jobs,
                                             Begin(stages, "triangulation")));
    return site;
  }
  SfmOptions sfm;
  sfm.colmap.work_folder = options.work_folder;
  sfm.colmap.seed = options.seed;
  sfm.colmap.refine_focal = input.focal_is_guess;
  sfm.cache = options.cache;
  SfmResult result =
      MapPhotographs(input, matched.candidates, matched.pairs, sfm, options.jobs, stages);
  site.maps = std::move(result.maps);
  if (site.maps.size() > 1) {
    site.warnings.push_back(
        Count(site.maps.size(), " maps that are not connected with each other"));
  }
  if (!result.unmapped.empty()) {
    site.warnings.push_back(Count(result.unmapped.size(), " images are in no map, the first: ") +
                            result.unmapped.front());
  }
  return site;
}

// To the site's frame, as far as it is known.
void Place(const ImageSet& set, const SiteMapOptions& options, SiteMap& site) {
  const bool known = options.source == MapSource::kPoses;
  PlaceReport report = PlaceMaps(site.maps, {.controls = options.controls,
                                             .folder = set.folder,
                                             .level = !known,
                                             .given_is_metric = known});
  site.metric = !report.placements.empty() && report.placements.front().metric;
  if (known && site.metric) site.site_from_set = report.placements.front().new_from_old;
  site.placements = std::move(report.placements);
  site.notes = std::move(report.notes);
  site.warnings.insert(site.warnings.end(), report.warnings.begin(), report.warnings.end());
}

SiteMap NoMap(const ImageSet& set, const SiteMapOptions& options, SiteMap site = {}) {
  if (options.controls.source.empty()) return site;
  throw ToolError(options.controls.source + ": no map to place by control points: " +
                  set.source.string() + " needs poses and a calibration, or ask for --map colmap");
}

nlohmann::ordered_json SimilarityAsJson(const Similarity& s) {
  const Eigen::Quaterniond& q = s.rotation;
  const Eigen::Vector3d& t = s.translation;
  return {
      {"scale", s.scale}, {"q_xyzw", {q.x(), q.y(), q.z(), q.w()}}, {"t", {t.x(), t.y(), t.z()}}};
}

Similarity SimilarityOf(const nlohmann::ordered_json& json) {
  const auto q = json.at("q_xyzw").get<std::array<double, 4>>();
  const auto t = json.at("t").get<std::array<double, 3>>();
  return {json.at("scale").get<double>(), Eigen::Quaterniond(q[3], q[0], q[1], q[2]),
          Eigen::Vector3d(t.data())};
}

nlohmann::ordered_json FitAsJson(const Georeference& fit) {
  nlohmann::ordered_json residuals = nlohmann::ordered_json::array();
  for (const ControlResidual& residual : fit.residuals) {
    residuals.push_back(
        {{"name", residual.name}, {"metres", residual.metres}, {"used", residual.is_inlier}});
  }
  return {{"median_m", fit.median_metres},
          {"upright_by_cameras", fit.upright_by_cameras},
          {"residuals", residuals}};
}

}  // namespace

SiteMap MapSite(const ImageSet& set, const FeatureStore& features, std::span<const int> image_idxs,
                const Eigen::MatrixXf& similarity, const SiteMapOptions& options,
                const std::function<Progress(const std::string& stage)>& stages) {
  if (options.source == MapSource::kNone) return NoMap(set, options);
  const std::vector<int> kept = Mappable(set, features, image_idxs, options.source);
  const bool known = options.source == MapSource::kPoses;
  SiteMap none;
  const std::string missing = known ? MissingCalibration(set, image_idxs) : "";
  if (!missing.empty()) none.warnings.push_back(missing);
  if (kept.size() < 2) return NoMap(set, options, std::move(none));
  std::vector<int> images;
  for (const int i : kept) images.push_back(image_idxs[i]);
  const MapInput input = MakeMapInput(set, features, images);
  MapInput without_poses = input;
  if (!known) {
    for (MapFrame& frame : without_poses.frames) frame.cam_from_world.reset();
  }
  const MapInput& used = known ? input : without_poses;
  const Matched matched = MatchFrames(used, similarity(kept, kept), known, options, stages);
  SiteMap site = Reconstruct(used, matched, options, stages);
  if (!missing.empty()) site.warnings.push_back(missing);
  if (!known) {
    site.warnings.insert(site.warnings.end(), input.warnings.begin(), input.warnings.end());
  }
  Place(set, options, site);
  return site;
}

std::string MissingCalibration(const ImageSet& set, std::span<const int> image_idxs) {
  const auto missing = std::count_if(image_idxs.begin(), image_idxs.end(), [&](int i) {
    return set.images[i].pose && set.images[i].camera_idx < 0;
  });
  if (missing == 0) return {};
  return Count(missing, " of ") + Count(image_idxs.size(), " images have no camera for a map: ") +
         set.DefaultCalibration().string() +
         " is wanted, or a column `camera` (`viewfix calibrate` makes the file)";
}

ImageSet WithMappedPoses(const ImageSet& set, const SiteMap& site) {
  ImageSet mapped = set;
  std::map<std::string, Rigid3> cam_from_world;
  for (std::size_t m = 0; m < site.maps.size(); ++m) {
    if (m > 0 && !(site.metric && site.placements[m].metric)) continue;
    for (const MapImage& image : site.maps[m].images) {
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

nlohmann::ordered_json MapsAsJson(const SiteMap& site) {
  nlohmann::ordered_json json;
  json["site_from_set"] = SimilarityAsJson(site.site_from_set);
  json["maps"] = nlohmann::ordered_json::array();
  for (std::size_t m = 0; m < site.maps.size(); ++m) {
    const MapPlacement& placement = site.placements[m];
    nlohmann::ordered_json row = {{"images", site.maps[m].images.size()},
                                  {"points", site.maps[m].points.size()},
                                  {"metric", placement.metric},
                                  {"levelled", placement.levelled},
                                  {"control", nullptr}};
    if (placement.fit) row["control"] = FitAsJson(*placement.fit);
    json["maps"].push_back(std::move(row));
  }
  return json;
}

Similarity SiteFromSet(const nlohmann::ordered_json& maps) {
  if (!maps.is_object() || !maps.contains("site_from_set")) return {};
  try {
    return SimilarityOf(maps["site_from_set"]);
  } catch (const nlohmann::json::exception&) {  // a record of another program
    return {};
  }
}

}  // namespace viewfix
