// SPDX-License-Identifier: BSD-3-Clause
#include "engine/matching/dot_tile.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>
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

using Descriptors = std::vector<std::int8_t>;  // [n, dim]

// Of about this length each, in random directions.
Descriptors OfLength(int n, int dim, double length, std::uint64_t seed) {
  Descriptors descriptors = RandomBytes(n * dim, seed);
  for (int i = 0; i < n; ++i) {
    double norm2 = 1;
    for (int d = 0; d < dim; ++d)
      norm2 += double(descriptors[i * dim + d]) * descriptors[i * dim + d];
    for (int d = 0; d < dim; ++d) {
      std::int8_t& value = descriptors[i * dim + d];
      value = static_cast<std::int8_t>(value * std::min(1.0, length / std::sqrt(norm2)));
    }
  }
  return descriptors;
}

std::int32_t Dot(const std::int8_t* a, const std::int8_t* b, int dim) {
  return std::inner_product(a, a + dim, b, 0);
}

// Rows of whole blocks, with their squared lengths.
struct Rows {
  Descriptors rows;
  std::vector<std::int32_t> norm2;
  int dim;

  int blocks() const { return static_cast<int>(norm2.size()) / kTileRows; }
  std::int32_t LikenessOf(const std::int8_t* query, int row) const {
    return 2 * Dot(query, &rows[row * dim], dim) - norm2[row];
  }
};

Rows RowsOf(const Descriptors& descriptors, int dim) {
  Rows rows = {descriptors, {}, dim};
  for (std::size_t r = 0; r < descriptors.size(); r += dim) {
    rows.norm2.push_back(Dot(&descriptors[r], &descriptors[r], dim));
  }
  return rows;
}

// Every block, in order, as FindAbove() gives them on every path.
void ExpectFound(const Descriptors& queries, const Rows& rows,
                 const std::vector<std::int32_t>& limits) {
  for (const CpuPath path : CpuPathsHere()) {
    const DotTile tile(rows.dim, path);
    std::vector<std::uint8_t> packed(tile.tile_bytes());
    tile.PackQueries(queries, packed.data());
    const std::vector<std::uint8_t> blocks = tile.PackBlocks(rows.rows);
    DotTile::Likeness likeness;
    int next = 0;
    for (int b = 0; b < rows.blocks(); ++b) {
      std::vector<std::uint32_t> above(kTileQueries);
      for (int q = 0; q < kTileQueries; ++q) {
        for (int r = 0; r < kTileRows; ++r) {
          const auto like = rows.LikenessOf(&queries[q * rows.dim], b * kTileRows + r);
          above[q] |= like > limits[q] ? 1U << r : 0U;
        }
      }
      if (std::ranges::count(above, 0U) == kTileQueries) continue;
      const int found =
          tile.FindAbove(packed.data(), {blocks.data(), rows.norm2.data(), rows.blocks()}, next,
                         limits.data(), likeness);
      ASSERT_EQ(found, b) << "path " << static_cast<int>(path) << " dim " << rows.dim;
      next = b + 1;
      for (int q = 0; q < kTileQueries; ++q) {
        ASSERT_EQ(likeness.above[q], above[q]) << "path " << static_cast<int>(path);
        for (int r = 0; r < kTileRows && above[q] != 0; ++r) {
          ASSERT_EQ(likeness.of_query[q][r],
                    rows.LikenessOf(&queries[q * rows.dim], b * kTileRows + r));
        }
      }
    }
    ASSERT_EQ(tile.FindAbove(packed.data(), {blocks.data(), rows.norm2.data(), rows.blocks()}, next,
                             limits.data(), likeness),
              rows.blocks());
  }
}

TEST(DotTile, IsExactForDescriptorsOfUsualLength) {
  for (const int dim : {2, 7, 64, 72, 127, 128}) {
    const Descriptors queries = OfLength(kTileQueries, dim, 127, 8);
    ExpectExactProducts(queries, OfLength(kTileRows, dim, 127, 9), dim);
    ExpectExactProducts(queries, queries, dim);
  }
}

// 7 u and 31 u with |u|^2 = 151.
TEST(DotTile, HoldsTheGreatestAndTheLeastShortSum) {
  constexpr int kDim = 124;
  for (const int sign : {1, -1}) {
    Descriptors queries, rows;
    for (int i = 0; i < kTileQueries * kDim; ++i) {
      const int u = i % kDim < 9 ? 2 : 1;
      queries.push_back(static_cast<std::int8_t>(sign * 7 * u));
      rows.push_back(static_cast<std::int8_t>(31 * u));
    }
    ASSERT_EQ(Dot(queries.data(), rows.data(), kDim), sign * 32767);
    ExpectExactProducts(queries, rows, kDim);
  }
}

TEST(DotTile, FindsTheBlocksThatAreAboveALimit) {
  using Int = std::numeric_limits<std::int32_t>;
  for (const int dim : {7, 64, 72, 128}) {
    const Descriptors queries = OfLength(kTileQueries, dim, 127, 3);
    // Usual rows; one long one in a block of them; a block of long ones; zeros.
    Descriptors all = OfLength(3 * kTileRows, dim, 127, 4);
    std::fill_n(all.begin() + (kTileRows + 5) * dim, dim, std::int8_t{127});
    const Descriptors far = OfLength(kTileRows, dim, 700, 5);
    all.insert(all.end(), far.begin(), far.end());
    all.resize(all.size() + std::size_t{kTileRows} * dim);
    const Rows rows = RowsOf(all, dim);
    // Each query's own limit lies just below, at and above what one of the rows has.
    for (int first = 0; first < rows.blocks() * kTileRows; first += 7) {
      for (const int more : {-1, 0, 1}) {
        std::vector<std::int32_t> limits;
        for (int q = 0; q < kTileQueries; ++q) {
          const int row = (first + 13 * q) % (rows.blocks() * kTileRows);
          limits.push_back(rows.LikenessOf(&queries[q * dim], row) + more);
        }
        ExpectFound(queries, rows, limits);
      }
    }
    for (const std::int32_t limit : {Int::min(), Int::min() + 1, -65538, -65537, -65536, -65535, -1,
                                     0, 65534, 65535, 65536, 65537, Int::max()}) {
      std::vector<std::int32_t> limits(kTileQueries, Int::max());
      limits[5] = limit;
      ExpectFound(queries, rows, limits);
    }
  }
}

TEST(DotTile, ZerosMayCountAsFarAway) {
  constexpr int kDim = 64;
  const Descriptors queries = OfLength(kTileQueries, kDim, 127, 3);
  Rows rows = RowsOf(Descriptors(kTileRows * kDim), kDim);
  std::ranges::fill(rows.norm2, std::numeric_limits<std::int32_t>::max());
  for (const std::int32_t limit : {std::numeric_limits<std::int32_t>::min(), -65536, 0}) {
    ExpectFound(queries, rows, std::vector<std::int32_t>(kTileQueries, limit));
  }
}

}  // namespace
}  // namespace viewfix
