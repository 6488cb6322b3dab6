// SPDX-License-Identifier: BSD-3-Clause
#include "engine/matching/dot_tile.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/engine/image/test_image.h"

namespace viewfix {
namespace {

std::vector<std::int8_t> RandomBytes(int count, std::uint64_t seed) {
  TestRandom random(seed);
  std::vector<std::int8_t> bytes(count);
  for (std::int8_t& byte : bytes) byte = static_cast<std::int8_t>(random.Below(256) - 128);
  return bytes;
}

// Queries and rows of one tile, packed.
struct Packed {
  std::vector<std::uint8_t> queries;
  std::vector<std::uint8_t> block;
};

// Over what was there before.
Packed Pack(const DotTile& tile, const std::vector<std::int8_t>& queries,
            const std::vector<std::int8_t>& rows, int dim) {
  Packed packed = {std::vector<std::uint8_t>(kTileQueries * tile.query_bytes(), 99),
                   std::vector<std::uint8_t>(tile.block_bytes(), 99)};
  const auto part = [dim](const std::vector<std::int8_t>& all, int i) {
    return std::span(all).subspan(i * dim, dim);
  };
  for (int q = 0; q < kTileQueries; ++q) {
    tile.PackQuery(part(queries, q), &packed.queries[q * tile.query_bytes()]);
  }
  for (int r = 0; r < kTileRows; ++r) tile.PackRow(part(rows, r), r, packed.block.data());
  return packed;
}

void ExpectExactProducts(const std::vector<std::int8_t>& queries,
                         const std::vector<std::int8_t>& rows, int dim) {
  for (const CpuPath path : CpuPathsHere()) {
    const DotTile tile(dim, path);
    const Packed packed = Pack(tile, queries, rows, dim);
    ASSERT_LE(packed.queries.size(), DotTile::kMaxTileBytes);
    std::vector<std::int32_t> products(kTileQueries * kTileRows);
    tile.Products(packed.queries.data(), packed.block.data(), products.data());
    for (int q = 0; q < kTileQueries; ++q) {
      for (int r = 0; r < kTileRows; ++r) {
        int expected = 0;
        for (int d = 0; d < dim; ++d) expected += queries[q * dim + d] * rows[r * dim + d];
        ASSERT_EQ(products[q * kTileRows + r], expected)
            << "path " << static_cast<int>(path) << " dim " << dim << " " << q << " " << r;
      }
    }
  }
}

TEST(DotTile, IsExactOnEveryPath) {
  for (const int dim : {1, 2, 7, 64, 127, 128}) {
    ExpectExactProducts(RandomBytes(kTileQueries * dim, 1), RandomBytes(kTileRows * dim, 2), dim);
  }
}

TEST(DotTile, HoldsTheLargestSums) {
  const int dim = kMaxDescriptorDim;
  const std::vector<std::int8_t> queries(kTileQueries * dim, -128);
  const std::vector<std::int8_t> rows(kTileRows * dim, -128);
  ExpectExactProducts(queries, rows, dim);
}

TEST(DotTile, ComparesLikenessWithEachQuerysLimit) {
  constexpr int kDim = 9;
  const std::vector<std::int8_t> queries = RandomBytes(kTileQueries * kDim, 3);
  const std::vector<std::int8_t> rows = RandomBytes(kTileRows * kDim, 4);
  std::vector<std::int32_t> norm2(kTileRows);
  for (int r = 0; r < kTileRows; ++r) norm2[r] = 1000 * r;
  for (const CpuPath path : CpuPathsHere()) {
    const DotTile tile(kDim, path);
    const Packed packed = Pack(tile, queries, rows, kDim);
    std::vector<std::int32_t> products(kTileQueries * kTileRows), likeness(products.size());
    tile.Products(packed.queries.data(), packed.block.data(), products.data());
    std::vector<std::int32_t> limits(kTileQueries);
    for (int q = 0; q < kTileQueries; ++q) {  // what one of the rows reaches, and none
      limits[q] = q == 0 ? 1 << 30 : 2 * products[q * kTileRows + q] - norm2[q];
    }
    std::vector<std::uint32_t> above(kTileQueries);
    tile.Likeness(packed.queries.data(), packed.block.data(), norm2.data(), limits.data(),
                  likeness.data(), above.data());
    for (int q = 0; q < kTileQueries; ++q) {
      for (int r = 0; r < kTileRows; ++r) {
        const int expected = 2 * products[q * kTileRows + r] - norm2[r];
        ASSERT_EQ(likeness[q * kTileRows + r], expected) << static_cast<int>(path);
        ASSERT_EQ(above[q] >> r & 1U, expected > limits[q] ? 1U : 0U) << q << " " << r;
      }
    }
  }
}

}  // namespace
}  // namespace viewfix
