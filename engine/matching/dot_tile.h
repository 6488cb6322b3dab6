// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

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
  static constexpr std::size_t kMaxTileBytes = std::size_t{kTileQueries} * 2 * kMaxDescriptorDim;

  // dim in 1..kMaxDescriptorDim
  DotTile(int dim, CpuPath path);

  std::size_t tile_bytes() const { return tile_bytes_; }    // of kTileQueries queries
  std::size_t block_bytes() const { return block_bytes_; }  // of kTileRows rows

  // Writes a descriptor [dim] as query `query` of a tile [tile_bytes].
  void PackQuery(std::span<const std::int8_t> descriptor, int query, std::uint8_t* tile) const;
  // Writes descriptors [n, dim], n <= kTileQueries, as the first queries of a tile.
  void PackQueries(std::span<const std::int8_t> descriptors, std::uint8_t* tile) const;
  // Writes a descriptor [dim] as row `row` of a block [block_bytes].
  void PackRow(std::span<const std::int8_t> descriptor, int row, std::uint8_t* block) const;

  //   queries [tile_bytes]   block [block_bytes]
  //   products [kTileQueries][kTileRows], those of a query `stride` behind those of the one before
  void Products(const std::uint8_t* queries, const std::uint8_t* block, std::int32_t* products,
                std::size_t stride = kTileRows) const {
    kernels_.products(queries, block, depth_, products, stride);
  }

  // How like each query is to each row of a block, and which rows are more like it than a limit.
  struct Likeness {
    // 2 q'r - |r|^2, greatest for the least |q - r|
    alignas(64) std::int32_t of_query[kTileQueries][kTileRows];
    std::uint32_t above[kTileQueries];  // bit r: of_query[q][r] > limits[q]
  };

  struct Blocks {
    const std::uint8_t* rows;   // [size][block_bytes]
    const std::int32_t* norm2;  // [size][kTileRows] |r|^2
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
  struct Kernels {
    void (*products)(const std::uint8_t* queries, const std::uint8_t* block, int depth,
                     std::int32_t* products, std::size_t stride);
    int (*find_above)(const std::uint8_t* queries, const Blocks& blocks, int begin, int depth,
                      const std::int32_t* limits, Likeness& likeness);
  };
  static Kernels KernelsFor(CpuPath path);
  void Pack(std::span<const std::int8_t> descriptor, int i, int offset, std::uint8_t* packed) const;

  int dim_;
  bool bytes_;  // values stay bytes; else they are widened to 16 bits
  int depth_;   // values of a query or row: dim, filled up with zeros
  std::size_t tile_bytes_;
  std::size_t block_bytes_;
  Kernels kernels_;
};

}  // namespace viewfix
