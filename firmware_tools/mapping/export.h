// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>

#include "firmware_tools/mapping/reconstruction.h"

namespace viewfix {

enum class ExportFormat { kColmap, kPly, kTum };

// Writes a map in a form that other programs open; each file as a whole or not at all. Throws
// ToolError naming the file and the cause.
//   kColmap  `path` is a folder, made if missing: a COLMAP text model (binary where an image's
//            name has a blank, which the text format cannot hold)
//   kPly     `path` gets the points (binary PLY, doubles), and NAME-cameras.ply beside NAME.ply
//            the camera centres in the order of the images
//   kTum     `path` gets the trajectory, world_from_cam, the images in order: `timestamp tx ty tz
//            qx qy qz qw`. The timestamp is the image's name without folder and extension where
//            that is a number for every image, else its index.
void Export(const Reconstruction& map, ExportFormat format, const std::filesystem::path& path);

}  // namespace viewfix
