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

void ExpectExactProducts(const std::vector<std::int8_t>& queries,
                         const std::vector<std::int8_t>& rows, int dim) {
  std::vector<std::int16_t> tile(kTileQueries * TileDim(dim), 99);
  std::vector<std::int16_t> block(kTileRows * TileDim(dim), 99);
  const auto part = [dim](const std::vector<std::int8_t>& all, int i) {
    return std::span(all).subspan(i * dim, dim);
  };
  for (int q = 0; q < kTileQueries; ++q) PackQuery(part(queries, q), &tile[q * TileDim(dim)]);
  for (int r = 0; r < kTileRows; ++r) PackRow(part(rows, r), r, block.data());
  for (const CpuPath path : CpuPathsHere()) {
    std::vector<std::int32_t> products(kTileQueries * kTileRows);
    DotTileFor(path)(tile.data(), block.data(), TileDim(dim), products.data());
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

TEST(LikenessTile, ComparesWithEachQuerysLimit) {
  constexpr int kDim = 9;
  const std::vector<std::int8_t> queries = RandomBytes(kTileQueries * kDim, 3);
  const std::vector<std::int8_t> rows = RandomBytes(kTileRows * kDim, 4);
  std::vector<std::int16_t> tile(kTileQueries * TileDim(kDim));
  std::vector<std::int16_t> block(kTileRows * TileDim(kDim));
  for (int q = 0; q < kTileQueries; ++q) {
    PackQuery(std::span(queries).subspan(q * kDim, kDim), &tile[q * TileDim(kDim)]);
  }
  std::vector<std::int32_t> norm2(kTileRows);
  for (int r = 0; r < kTileRows; ++r) {
    PackRow(std::span(rows).subspan(r * kDim, kDim), r, block.data());
    norm2[r] = 1000 * r;
  }
  for (const CpuPath path : CpuPathsHere()) {
    std::vector<std::int32_t> products(kTileQueries * kTileRows), likeness(products.size());
    DotTileFor(path)(tile.data(), block.data(), TileDim(kDim), products.data());
    std::vector<std::int32_t> limits(kTileQueries);
    for (int q = 0; q < kTileQueries; ++q) {  // what one of the rows reaches, and none
      limits[q] = q == 0 ? 1 << 30 : 2 * products[q * kTileRows + q] - norm2[q];
    }
    std::vector<std::uint32_t> above(kTileQueries);
    LikenessTileFor(path)(tile.data(), block.data(), TileDim(kDim), norm2.data(), limits.data(),
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
