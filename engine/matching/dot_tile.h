// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/base/cpu_path.h"

namespace viewfix {

inline constexpr int kTileRows = 16;
inline constexpr int kTileQueries = 8;
// Longest descriptor.
inline constexpr int kMaxDescriptorDim = 128;

// All dot products of a few queries with a block of rows, in integers: exact, the same on every
// path. Rows lie side by side in the block, so that each lane of a vector sums for one row and
// nothing is summed across lanes; what is loaded of a block serves all queries of the tile.
// Queries and blocks are packed as the path wants them, into bytes of the caller's.
class DotTile {
 public:
  // Bytes of kTileQueries queries of any dim, on any path.
  static constexpr std::size_t kMaxTileBytes = std::size_t{kTileQueries} * 2 * kMaxDescriptorDim;

  // dim in 1..kMaxDescriptorDim
  DotTile(int dim, CpuPath path);

  std::size_t query_bytes() const { return query_bytes_; }
  std::size_t block_bytes() const { return block_bytes_; }  // of kTileRows rows

  // Writes a descriptor [dim] as a query [query_bytes].
  void PackQuery(std::span<const std::int8_t> descriptor, std::uint8_t* query) const;
  // Writes a descriptor [dim] as row `row` of a block [block_bytes].
  void PackRow(std::span<const std::int8_t> descriptor, int row, std::uint8_t* block) const;

  //   queries [kTileQueries][query_bytes]   block [block_bytes]
  //   products [kTileQueries][kTileRows]
  void Products(const std::uint8_t* queries, const std::uint8_t* block,
                std::int32_t* products) const {
    kernels_.products(queries, block, depth_, products);
  }

  // How like each query is to each row, and which rows are more like it than a limit:
  //   norm2 [kTileRows] |r|^2   limits [kTileQueries]
  //   likeness [kTileQueries][kTileRows] 2 q'r - |r|^2, greatest for the least |q - r|
  //   above [kTileQueries] bit r: likeness[r] > limit
  void Likeness(const std::uint8_t* queries, const std::uint8_t* block, const std::int32_t* norm2,
                const std::int32_t* limits, std::int32_t* likeness, std::uint32_t* above) const {
    kernels_.likeness(queries, block, depth_, norm2, limits, likeness, above);
  }

 private:
  struct Kernels {
    void (*products)(const std::uint8_t* queries, const std::uint8_t* block, int depth,
                     std::int32_t* products);
    void (*likeness)(const std::uint8_t* queries, const std::uint8_t* block, int depth,
                     const std::int32_t* norm2, const std::int32_t* limits, std::int32_t* likeness,
                     std::uint32_t* above);
  };
  static Kernels KernelsFor(CpuPath path);

  bool bytes_;  // values stay bytes; else they are widened to 16 bits
  int depth_;   // values of a query or row: dim, filled up with zeros
  std::size_t query_bytes_;
  std::size_t block_bytes_;
  Kernels kernels_;
};

}  // namespace viewfix
