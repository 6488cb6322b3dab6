// SPDX-License-Identifier: BSD-3-Clause
#include "engine/matching/code_tables.h"

#include <array>
#include <cassert>

#include "models/model_view.h"

namespace viewfix {
namespace {

constexpr int kBlocksOfPart = kCodesOfPart / kTileRows;
static_assert(kBlocksOfPart * kTileRows == kCodesOfPart);

}  // namespace

CodeTables::CodeTables(std::span<const std::int8_t> codebook, int parts, int dim, CpuPath path)
    : parts_(parts),
      piece_(dim / parts),
      table_size_(std::size_t(parts) * kCodesOfPart),
      tile_(piece_, path),
      blocks_(tile_.PackBlocks(codebook)),
      tables_(kTileQueries * table_size_) {}

void CodeTables::Fill(std::span<const std::int8_t> descriptors) {
  std::array<std::uint8_t, DotTile::kMaxTileBytes> queries{};
  const int dim = parts_ * piece_;
  const int n = static_cast<int>(descriptors.size()) / dim;
  assert(n <= kTileQueries);
  for (int p = 0; p < parts_; ++p) {
    for (int i = 0; i < n; ++i) {
      tile_.PackQuery(descriptors.subspan(std::size_t(i) * dim + p * piece_, piece_), i,
                      queries.data());
    }
    for (int b = p * kBlocksOfPart; b < (p + 1) * kBlocksOfPart; ++b) {
      tile_.Products(queries.data(), &blocks_[b * tile_.block_bytes()], &tables_[b * kTileRows],
                     table_size_);
    }
  }
}

}  // namespace viewfix
