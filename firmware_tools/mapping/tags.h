// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "firmware_tools/mapping/georeference.h"
#include "firmware_tools/mapping/reconstruction.h"

namespace viewfix {

// A printed tag whose place on the site is known.
struct Tag {
  std::string family;  // 4x4_50 ... 7x7_1000, aruco_original, tag16h5, tag25h9, tag36h10, tag36h11
  int id = 0;
  // Of the black border, seen from the front: top left, top right, bottom right, bottom left.
  std::array<Eigen::Vector3d, 4> corners_in_site;
};

// CSV with the columns family,id and either size_m,tx,ty,tz,qx,qy,qz,qw (site_from_tag: the tag's
// middle; x to its right, y up, z out of it towards the reader) or the corners
// x0,y0,z0,...,x3,y3,z3 in Tag's order. Throws ToolError naming file, line and cause.
std::vector<Tag> ReadTagFile(const std::filesystem::path& file);

struct TagObservation {
  int image_idx = 0;                       // into Reconstruction::images
  int tag_idx = 0;                         // into the tags
  std::array<Eigen::Vector2d, 4> corners;  // pixels of the image's camera
};

// Looks for the tags in the map's images, which stand in `folder`; an image that cannot be read,
// or shows the same tag twice, gives nothing. Pixels are brought to the size of the camera.
std::vector<TagObservation> DetectTags(const Reconstruction& map, std::span<const Tag> tags,
                                       const std::filesystem::path& folder);

// Places the tags' corners in the map by the rays through them, as control points called
// "tag36h11 7 corner 0". A corner needs two rays at 2 degrees or more; rays that miss the point by
// more than 1 degree are dropped, once. In the order of tags and corners.
std::vector<ControlPair> TriangulateTags(const Reconstruction& map, std::span<const Tag> tags,
                                         std::span<const TagObservation> observations);

}  // namespace viewfix
