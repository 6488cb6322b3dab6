// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/site_frame.h"

#include <algorithm>
#include <cstdio>

#include "firmware_tools/dataset/image_set.h"

namespace viewfix {
namespace {

constexpr std::size_t kLeastControls = 3;  // that place a map

std::string MapName(std::size_t map_idx) {
  std::string name = "map ";
  name += std::to_string(map_idx);
  return name;
}

std::vector<ControlPair> PairsOf(const Reconstruction& map, const PlaceOptions& options) {
  std::vector<ControlPair> pairs = PairWithCameras(map, options.controls.points);
  if (options.controls.tags.empty()) return pairs;
  const auto seen = DetectTags(map, options.controls.tags, options.folder);
  for (ControlPair& corner : TriangulateTags(map, options.controls.tags, seen)) {
    pairs.push_back(std::move(corner));
  }
  return pairs;
}

// The points of each map. Maps that have enough come first, else the largest stays a map of its own
// frame although a smaller one has all the points.
std::vector<std::vector<ControlPair>> PutControlledFirst(std::vector<Reconstruction>& maps,
                                                         const PlaceOptions& options) {
  std::vector<std::vector<ControlPair>> of_map;
  for (const Reconstruction& map : maps) of_map.push_back(PairsOf(map, options));
  std::size_t next = 0;
  for (std::size_t m = 0; m < maps.size(); ++m) {
    if (of_map[m].size() < kLeastControls) continue;
    std::rotate(maps.begin() + next, maps.begin() + m, maps.begin() + m + 1);
    std::rotate(of_map.begin() + next, of_map.begin() + m, of_map.begin() + m + 1);
    ++next;
  }
  return of_map;
}

Georeference FitToSite(const Reconstruction& map, std::span<const ControlPair> controls) {
  Georeference fit = FitGeoreference(controls, EstimateGravity(map));
  if (IsUpsideDown(map, fit.site_from_map)) {
    throw ToolError(
        "the control points stand the map on its head: are their z upwards, and x, y, "
        "z right-handed?");
  }
  return fit;
}

MapPlacement PlaceByControls(Reconstruction& map, Georeference fit) {
  MapPlacement placement;
  placement.metric = true;
  placement.levelled = true;
  placement.new_from_old = fit.site_from_map;
  placement.fit = std::move(fit);
  Transform(map, placement.new_from_old);
  return placement;
}

MapPlacement LevelMap(Reconstruction& map, const std::string& name, PlaceReport& report) {
  MapPlacement placement;
  const Gravity gravity = EstimateGravity(map);
  if (!gravity.up_in_map) {
    report.warnings.push_back(name + " is not level: " + gravity.cause);
    return placement;
  }
  placement.levelled = true;
  placement.new_from_old = LevelFromMap(*gravity.up_in_map);
  Transform(map, placement.new_from_old);
  return placement;
}

MapPlacement LeaveFree(Reconstruction& map, const std::string& name, const PlaceOptions& options,
                       PlaceReport& report) {
  if (options.level) return LevelMap(map, name, report);
  MapPlacement placement;
  placement.metric = options.given_is_metric;
  return placement;
}

std::string FitNote(const std::string& name, const Georeference& fit) {
  char median[64];
  std::snprintf(median, sizeof median, ": control points, median %.3f m: ", fit.median_metres);
  const char* upright =
      fit.upright_by_cameras ? "; nearly on a line, so the cameras say which way is up" : "";
  return name + median + DescribeResiduals(fit) + upright;
}

MapPlacement Place(Reconstruction& map, std::size_t map_idx, std::span<const ControlPair> controls,
                   const PlaceOptions& options, PlaceReport& report) {
  const std::string name = MapName(map_idx);
  if (options.controls.source.empty()) return LeaveFree(map, name, options, report);
  try {
    MapPlacement placement = PlaceByControls(map, FitToSite(map, controls));
    report.notes.push_back(FitNote(name, *placement.fit));
    return placement;
  } catch (const ToolError& error) {
    if (map_idx == 0) throw ToolError(options.controls.source + ": " + error.what());
    report.warnings.push_back(name + " is not in the site's coordinates: " + error.what());
  }
  return LeaveFree(map, name, options, report);
}

}  // namespace

SiteControls ReadSiteControls(const std::filesystem::path& control_file,
                              const std::filesystem::path& tag_file) {
  SiteControls controls;
  if (!control_file.empty()) {
    controls.points = ReadControlFile(control_file);
    controls.source = control_file.string();
  }
  if (!tag_file.empty()) {
    controls.tags = ReadTagFile(tag_file);
    controls.source.append(controls.source.empty() ? "" : ", ").append(tag_file.string());
  }
  return controls;
}

PlaceReport PlaceMaps(std::vector<Reconstruction>& maps, const PlaceOptions& options) {
  PlaceReport report;
  const auto controls = PutControlledFirst(maps, options);
  for (std::size_t m = 0; m < maps.size(); ++m) {
    report.placements.push_back(Place(maps[m], m, controls[m], options, report));
  }
  return report;
}

}  // namespace viewfix
