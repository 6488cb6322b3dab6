// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/base/cpu_path.h"

namespace viewfix {

// All dot products of a few queries with a block of rows, in integers: exact. Rows lie side
// by side in the block, so that each lane of a vector sums for one row and nothing is summed
// across lanes; what is loaded of a block serves all queries of the tile.
inline constexpr int kTileRows = 16;
inline constexpr int kTileQueries = 8;
// Longest descriptor.
inline constexpr int kMaxDescriptorDim = 128;

// Values of a query or row as tiles hold it: filled up with a zero to an even number.
constexpr int TileDim(int dim) { return (dim + 1) / 2 * 2; }

// Writes a descriptor as a query: [TileDim].
void PackQuery(std::span<const std::int8_t> descriptor, std::int16_t* query);
// Writes a descriptor as row `row` of a block of kTileRows rows: [TileDim * kTileRows].
void PackRow(std::span<const std::int8_t> descriptor, int row, std::int16_t* block);

//   queries [kTileQueries][tile_dim]   block of kTileRows rows
//   products [kTileQueries][kTileRows]
using DotTile = void (*)(const std::int16_t* queries, const std::int16_t* block, int tile_dim,
                         std::int32_t* products);
DotTile DotTileFor(CpuPath path);

// How like each query is to each row, and which rows are more like it than a limit:
//   norm2 [kTileRows] |r|^2   limits [kTileQueries]
//   likeness [kTileQueries][kTileRows] 2 q'r - |r|^2, greatest for the least |q - r|
//   above [kTileQueries] bit r: likeness[r] > limit
using LikenessTile = void (*)(const std::int16_t* queries, const std::int16_t* block, int tile_dim,
                              const std::int32_t* norm2, const std::int32_t* limits,
                              std::int32_t* likeness, std::uint32_t* above);
LikenessTile LikenessTileFor(CpuPath path);

}  // namespace viewfix
