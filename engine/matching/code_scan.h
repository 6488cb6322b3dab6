// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "engine/base/cpu_path.h"
#include "models/model_view.h"

namespace viewfix {

// Details by their codes, many at once: which of them may be near a descriptor. Where a
// processor looks up whole vectors in a table, this passes over far ones faster than a loop
// over details could; those that are left are for the caller to judge.
inline constexpr int kScanBlockShift = 5;
inline constexpr int kScanBlock = 1 << kScanBlockShift;

//   table [parts, kCodesOfPart] what each code adds
//   codes [num_blocks, parts, kScanBlock]   half_norm2 [num_blocks, kScanBlock] >= 0
//   sums [num_blocks, kScanBlock] over parts of table[p][code]; must fit into 16 bits
//   found [num_blocks] bit i: sums[i] - half_norm2[i] >= least, the difference cut to 16 bits
using ScanCodes = void (*)(const std::int16_t* table, const std::uint8_t* codes,
                           const std::int16_t* half_norm2, int parts, int num_blocks,
                           std::int16_t least, std::int16_t* sums, std::uint32_t* found);
// Null where a path has no such lookup.
ScanCodes ScanCodesFor(CpuPath path);

}  // namespace viewfix
