// SPDX-License-Identifier: BSD-3-Clause
#include "engine/matching/dot_tile.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "tests/engine/matching/random_bytes.h"

namespace viewfix {
namespace {

// Queries and rows of one tile, packed.
struct Packed {
  std::vector<std::uint8_t> queries;
  std::vector<std::uint8_t> block;
};

// Over what was there before.
Packed Pack(const DotTile& tile, const std::vector<std::int8_t>& queries,
            const std::vector<std::int8_t>& rows, int dim) {
  Packed packed = {std::vector<std::uint8_t>(tile.tile_bytes(), 99),
                   std::vector<std::uint8_t>(tile.block_bytes(), 99)};
  const auto part = [dim](const std::vector<std::int8_t>& all, int i) {
    return std::span(all).subspan(i * dim, dim);
  };
  for (int q = 0; q < kTileQueries; ++q) tile.PackQuery(part(queries, q), q, packed.queries.data());
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

// Products about the greatest number of 16 bits, and values whose negative is no byte.
TEST(DotTile, IsExactWhereShortSumsEnd) {
  const int dim = kMaxDescriptorDim;
  const auto all = [dim](int value) {
    return std::vector<std::int8_t>(kTileQueries * dim, static_cast<std::int8_t>(value));
  };
  for (const int value : {15, 16, -15, -16}) ExpectExactProducts(all(value), all(16), dim);
  for (const int row : {-1, 0, 1}) ExpectExactProducts(all(-128), all(row), dim);
  for (const int query : {-1, 0, 1}) ExpectExactProducts(all(query), all(-128), dim);
  // Only one half of the tile is too long.
  for (const int query : {0, kTileQueries - 1}) {
    std::vector<std::int8_t> queries = all(3);
    std::fill_n(queries.begin() + query * dim, dim, std::int8_t{127});
    ExpectExactProducts(queries, RandomBytes(kTileRows * dim, 7), dim);
  }
}

// A block that held long rows before.
TEST(DotTile, ForgetsTheRowsThatWereThere) {
  const int dim = kMaxDescriptorDim;
  const std::vector<std::int8_t> ones(dim, 1), longest(dim, -128);
  for (const CpuPath path : CpuPathsHere()) {
    const DotTile tile(dim, path);
    std::vector<std::uint8_t> block(tile.block_bytes()), again(tile.block_bytes());
    for (int r = 0; r < kTileRows; ++r) tile.PackRow(longest, r, block.data());
    for (int r = 0; r < kTileRows; ++r) tile.PackRow(ones, r, block.data());
    for (int r = 0; r < kTileRows; ++r) tile.PackRow(ones, r, again.data());
    EXPECT_EQ(block, again) << static_cast<int>(path);
  }
}

TEST(DotTile, WritesProductsApart) {
  constexpr int kDim = 12, kStride = 2 * kTileRows;
  const std::vector<std::int8_t> queries = RandomBytes(kTileQueries * kDim, 3);
  const std::vector<std::int8_t> rows = RandomBytes(kTileRows * kDim, 4);
  for (const CpuPath path : CpuPathsHere()) {
    const DotTile tile(kDim, path);
    const Packed packed = Pack(tile, queries, rows, kDim);
    std::vector<std::int32_t> together(kTileQueries * kTileRows), apart(kTileQueries * kStride, 99);
    tile.Products(packed.queries.data(), packed.block.data(), together.data());
    tile.Products(packed.queries.data(), packed.block.data(), apart.data(), kStride);
    for (int q = 0; q < kTileQueries; ++q) {
      for (int r = 0; r < kStride; ++r) {
        ASSERT_EQ(apart[q * kStride + r], r < kTileRows ? together[q * kTileRows + r] : 99);
      }
    }
  }
}

TEST(DotTile, FindsTheBlocksThatAreAboveALimit) {
  constexpr int kDim = 9, kBlocks = 4;
  const std::vector<std::int8_t> queries = RandomBytes(kTileQueries * kDim, 3);
  std::vector<std::int32_t> norm2(kBlocks * kTileRows);
  for (int r = 0; r < kBlocks * kTileRows; ++r) {
    norm2[r] = 1000 * r + (r / kTileRows == 2 ? 0 : 200'000);
  }
  for (const CpuPath path : CpuPathsHere()) {
    const DotTile tile(kDim, path);
    std::vector<std::uint8_t> rows;
    Packed packed;
    std::vector<std::vector<std::int32_t>> products(kBlocks);
    for (int b = 0; b < kBlocks; ++b) {
      packed = Pack(tile, queries, RandomBytes(kTileRows * kDim, b + 5), kDim);
      rows.insert(rows.end(), packed.block.begin(), packed.block.end());
      products[b].resize(kTileQueries * kTileRows);
      tile.Products(packed.queries.data(), packed.block.data(), products[b].data());
    }
    const auto likeness_of = [&](int b, int q, int r) {
      return 2 * products[b][q * kTileRows + r] - norm2[b * kTileRows + r];
    };
    // Only query 5 goes beyond its limit, in block 2.
    std::vector<std::int32_t> limits(kTileQueries, std::numeric_limits<std::int32_t>::max());
    limits[5] = likeness_of(2, 5, 7) - 1;
    for (const int b : {0, 1, 3}) {
      for (int r = 0; r < kTileRows; ++r) ASSERT_LE(likeness_of(b, 5, r), limits[5]);
    }
    DotTile::Likeness likeness;
    const DotTile::Blocks blocks = {rows.data(), norm2.data(), kBlocks};
    const auto find = [&](int begin) {
      return tile.FindAbove(packed.queries.data(), blocks, begin, limits.data(), likeness);
    };
    ASSERT_EQ(find(3), kBlocks) << static_cast<int>(path);
    ASSERT_EQ(find(0), 2) << static_cast<int>(path);
    for (int q = 0; q < kTileQueries; ++q) {
      for (int r = 0; r < kTileRows; ++r) {
        if (likeness.above[q] != 0) {
          ASSERT_EQ(likeness.of_query[q][r], likeness_of(2, q, r)) << static_cast<int>(path);
        }
        ASSERT_EQ(likeness.above[q] >> r & 1U, likeness_of(2, q, r) > limits[q] ? 1U : 0U);
      }
    }
    ASSERT_EQ(find(2), 2);
  }
}

}  // namespace
}  // namespace viewfix
