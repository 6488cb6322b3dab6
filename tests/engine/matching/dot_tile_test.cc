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

}  // namespace
}  // namespace viewfix
