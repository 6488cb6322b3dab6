// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "firmware_tools/mapping/georeference.h"
#include "firmware_tools/mapping/reconstruction.h"
#include "firmware_tools/mapping/tags.h"

namespace viewfix {

// What is known of the site's coordinates.
struct SiteControls {
  std::string source;  // the files, for messages; empty: nothing is known
  std::vector<ControlPoint> points;
  std::vector<Tag> tags;
};

// Either path may be empty. Throws as ReadControlFile() and ReadTagFile().
SiteControls ReadSiteControls(const std::filesystem::path& control_file,
                              const std::filesystem::path& tag_file);

// How a map came to its frame of reference.
struct MapPlacement {
  bool metric = false;    // units are metres
  bool levelled = false;  // z is up
  Similarity new_from_old;
  std::optional<Georeference> fit;  // to the control points; none: not by them
};

struct PlaceOptions {
  SiteControls controls;
  std::filesystem::path folder;  // of the images, to look for tags in
  // Maps not placed by control points keep their frame, metres where `given_is_metric`; or are
  // turned so that z is up, where the cameras tell.
  bool level = false;
  bool given_is_metric = false;
};

struct PlaceReport {
  std::vector<MapPlacement> placements;  // [maps]
  std::vector<std::string> notes;        // residuals, for people
  std::vector<std::string> warnings;
};

// Takes maps, the largest first, to the site's frame by the control points and tags that each of
// them sees; others stay free. Maps that see three or more are put before the others. Throws
// ToolError naming the control files: the first map has too few of them even so, does not fit them,
// or would stand on its head.
PlaceReport PlaceMaps(std::vector<Reconstruction>& maps, const PlaceOptions& options);

}  // namespace viewfix
