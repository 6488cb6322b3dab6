// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>

#include "firmware_tools/mapping/reconstruction.h"

namespace viewfix {

enum class ColmapFormat { kText, kBinary };

// In which format `folder` holds a COLMAP model: cameras, images and points3D, .bin or .txt
// (.bin where it holds both, as COLMAP has it). Nothing: it holds none.
std::optional<ColmapFormat> FindColmapModel(const std::filesystem::path& folder);

// Reads a COLMAP 3.x sparse model. Cameras, images and points come in the order of their ids,
// pixels with their centres at integers. Camera models: SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL,
// RADIAL, OPENCV, FULL_OPENCV, OPENCV_FISHEYE, SIMPLE_RADIAL_FISHEYE and RADIAL_FISHEYE.
// Of several observations of a point in one image the first is kept. Colours are not.
// Throws ToolError naming the file (and line, or byte) and the cause: a file missing, cut short,
// a number that is not finite, an id given twice or referred to but absent, tracks and images
// that contradict each other, another camera model.
Reconstruction ReadColmapModel(const std::filesystem::path& folder);

// Writes a model that COLMAP reads, making `folder` if it is missing; every file is replaced as
// a whole. Ids are indices plus 1; images without key points keep their empty line. Throws
// ToolError: not writable; `folder` holds a model in the other format, which would be mixed up
// with this one; kText and a name with a blank in it, which COLMAP cannot read.
void WriteColmapModel(const Reconstruction& map, const std::filesystem::path& folder,
                      ColmapFormat format);

}  // namespace viewfix
