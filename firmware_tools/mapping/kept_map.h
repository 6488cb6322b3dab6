// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "firmware_tools/common/stage_cache.h"
#include "firmware_tools/mapping/colmap_mapper.h"
#include "firmware_tools/mapping/map_input.h"
#include "firmware_tools/mapping/reconstruction.h"
#include "firmware_tools/mapping/two_view.h"

namespace viewfix {

// Maps that structure from motion made of photographs, kept from run to run: one of a room to which
// no photograph was added needs not be made again.

// Of all that decides a map of the frames that have features, but for SfmOptions' defaults. Their
// poses are not used.
//   candidates, pairs  of those frames, as MapPhotographs() takes them
Hash256 MapKey(const MapInput& input, std::span<const FramePair> candidates,
               std::span<const VerifiedPair> pairs, const ColmapOptions& options);

// A map in a file of StageCache. Indices are within range in what Load() takes.
struct MapCodec {
  void Save(const Reconstruction& map, ByteWriter& writer) const;
  bool Load(ByteReader& reader, Reconstruction& map) const;
};

}  // namespace viewfix
