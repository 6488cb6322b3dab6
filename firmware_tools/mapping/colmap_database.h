// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>

#include "firmware_tools/mapping/map_input.h"
#include "firmware_tools/mapping/two_view.h"

namespace viewfix {

// Ids in COLMAP's database: indices plus 1.
inline std::int64_t ColmapId(int idx) { return idx + 1; }

// COLMAP's number of a pair of images, whose ids ascend.
inline std::int64_t ColmapPairId(const FramePair& frames) {
  return ColmapId(frames.first_idx) * 2147483647 + ColmapId(frames.second_idx);
}

// Fills a database that `colmap database_creator` made with what its mapper reads: cameras,
// images with features, key points (pixel centres at +0.5) and verified matches. No descriptors,
// and none of the matrices, which it works out itself. Throws ToolError naming the file and
// SQLite's reason; the file then is as it was.
void WriteColmapDatabase(const MapInput& input, std::span<const VerifiedPair> pairs,
                         const std::filesystem::path& file);

}  // namespace viewfix
