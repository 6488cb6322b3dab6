// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/cpu_path.h"

namespace viewfix {

inline constexpr int kTileRows = 16;
inline constexpr int kTileQueries = 16;
// Longest descriptor.
inline constexpr int kMaxDescriptorDim = 128;

// All dot products of a tile of queries with a block of rows, in integers: exact, the same on every
// path. Rows lie side by side in the block, so that each lane of a vector sums for one row and
// nothing is summed across lanes; what is loaded of a block serves all queries of the tile.
// Tiles and blocks are packed as the path wants them, into bytes of the caller's.
class DotTile {
 public:
  // Bytes of a tile of queries of any dim, on any path.
  static constexpr std::size_t kMaxTileBytes =
      kTileQueries * (2 * std::size_t{kMaxDescriptorDim} + sizeof(std::int32_t));

  // dim in 1..kMaxDescriptorDim
  DotTile(int dim, CpuPath path);

  std::size_t tile_bytes() const { return tile_bytes_; }    // of kTileQueries queries
  std::size_t block_bytes() const { return block_bytes_; }  // of kTileRows rows

  // Writes a descriptor [dim] as query `query` of a tile [tile_bytes].
  void PackQuery(std::span<const std::int8_t> descriptor, int query, std::uint8_t* tile) const;
  // Writes descriptors [n, dim], n <= kTileQueries, as the first queries of a tile.
  void PackQueries(std::span<const std::int8_t> descriptors, std::uint8_t* tile) const;
  // Writes a descriptor [dim] as row `row` of a block [block_bytes], whose rows are written in
  // order.
  void PackRow(std::span<const std::int8_t> descriptor, int row, std::uint8_t* block) const;
  // Descriptors [n, dim] as the rows of blocks, the last of which is filled up with zeros.
  std::vector<std::uint8_t> PackBlocks(std::span<const std::int8_t> descriptors) const;

  //   queries [tile_bytes]   block [block_bytes]
  //   products [kTileQueries][kTileRows], those of a query `stride` behind those of the one before
  void Products(const std::uint8_t* queries, const std::uint8_t* block, std::int32_t* products,
                std::size_t stride = kTileRows) const {
    kernels_.products(queries, block, depth_, products, stride);
  }

  // How like each query is to each row of a block, and which rows are more like it than a limit.
  struct Likeness {
    // 2 q'r - |r|^2, greatest for the least |q - r|; written where above[q] is not 0
    alignas(64) std::int32_t of_query[kTileQueries][kTileRows];
    std::uint32_t above[kTileQueries];  // bit r: of_query[q][r] > limits[q]
  };

  struct Blocks {
    const std::uint8_t* rows;   // [size][block_bytes]
    const std::int32_t* norm2;  // [size][kTileRows] |r|^2; any up to the largest if r is zero
    int size;
  };
  // The first of the blocks from `begin` on in which any query has a row above its limit, and the
  // likeness of its rows. blocks.size: none has, and what `likeness` holds says nothing.
  //   queries [tile_bytes]   limits [kTileQueries]
  int FindAbove(const std::uint8_t* queries, const Blocks& blocks, int begin,
                const std::int32_t* limits, Likeness& likeness) const {
    return kernels_.find_above(queries, blocks, begin, depth_, limits, likeness);
  }

 private:
  // What a path brings: how values lie in tiles and blocks, and what multiplies them.
  struct Kernels {
    // Packs a descriptor as query or row `i`, `offset` added to each value.
    using Pack = void (*)(std::span<const std::int8_t> descriptor, int i, int offset, int depth,
                          std::uint8_t* packed);
    Pack pack_query = nullptr;
    Pack pack_row = nullptr;
    int together = 1;     // values of a query or a row that lie side by side
    int copies = 1;       // of those, of a query
    int value_bytes = 1;  // 2: values are widened to 16 bits
    // Added to rows' values; tiles end with what takes it back, if it is not 0.
    int row_offset = 0;
    // If not 0, bytes that blocks end with, the squared length of the longest row first; tiles then
    // end with their queries' squared lengths, the largest number for what has a -128, whose
    // negative is no byte.
    std::size_t block_tail_bytes = 0;

    void (*products)(const std::uint8_t* queries, const std::uint8_t* block, int depth,
                     std::int32_t* products, std::size_t stride) = nullptr;
    int (*find_above)(const std::uint8_t* queries, const Blocks& blocks, int begin, int depth,
                      const std::int32_t* limits, Likeness& likeness) = nullptr;
  };
  static Kernels KernelsFor(CpuPath path);  // dot_tile_x86.cc, dot_tile_arm.cc

  int dim_;
  Kernels kernels_;
  int depth_;              // values of a query or row: dim, filled up with zeros
  std::size_t tile_end_;   // where what a tile ends with begins
  std::size_t block_end_;  // likewise of a block
  std::size_t tile_bytes_;
  std::size_t block_bytes_;
};

}  // namespace viewfix
