// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/cpu_path.h"
#include "engine/matching/dot_tile.h"

namespace viewfix {

// What each code adds to a product with a descriptor, for a tile of descriptors at once: the
// look-up tables of product quantization. Exact in integers. Allocates in the constructor only.
// H. Jegou, M. Douze, C. Schmid, Product quantization for nearest neighbor search, PAMI 2011.
class CodeTables {
 public:
  //   codebook [parts, kCodesOfPart, dim / parts], copied; dim / parts in 1..kMaxDescriptorDim
  CodeTables(std::span<const std::int8_t> codebook, int parts, int dim, CpuPath path);

  // descriptors [n, dim], n in 1..kTileQueries
  void Fill(std::span<const std::int8_t> descriptors);
  // Of descriptor i of those: q_p'c [parts, kCodesOfPart]
  const std::int32_t* Of(int i) const { return tables_.data() + i * table_size_; }

 private:
  int parts_;
  int piece_;  // dim / parts
  std::size_t table_size_;
  DotTile tile_;
  std::vector<std::uint8_t> blocks_;  // of codes, part after part
  std::vector<std::int32_t> tables_;  // [kTileQueries, parts, kCodesOfPart]
};

}  // namespace viewfix
