// SPDX-License-Identifier: BSD-3-Clause
#include "engine/matching/dot_tile.h"

#include <array>
#include <cstring>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace viewfix {
namespace {

#if defined(__x86_64__)

// x86 multiplies pairs of 16-bit numbers and adds the two products at once.
constexpr int kTogether = 2;

int Pair(const std::int16_t* values) {
  int pair;
  std::memcpy(&pair, values, sizeof(pair));
  return pair;
}

void TileSse2(const std::int16_t* queries, const std::int16_t* block, int tile_dim,
              std::int32_t* products) {
  constexpr int kQueriesAtOnce = 2;  // of the 16 registers
  constexpr int kVectors = 4;
  for (int q = 0; q < kTileQueries; q += kQueriesAtOnce) {
    __m128i sums[kQueriesAtOnce][kVectors] = {};
    for (int d = 0; d < tile_dim; d += kTogether) {
      const auto* rows = reinterpret_cast<const __m128i*>(block + d * kTileRows);
      for (int i = 0; i < kQueriesAtOnce; ++i) {
        const __m128i pair = _mm_set1_epi32(Pair(queries + (q + i) * tile_dim + d));
        for (int v = 0; v < kVectors; ++v) {
          const __m128i product = _mm_madd_epi16(_mm_loadu_si128(rows + v), pair);
          sums[i][v] = _mm_add_epi32(sums[i][v], product);
        }
      }
    }
    std::memcpy(products + q * kTileRows, sums, sizeof(sums));
  }
}

[[gnu::target("avx2")]] void TileAvx2(const std::int16_t* queries, const std::int16_t* block,
                                      int tile_dim, std::int32_t* products) {
  constexpr int kQueriesAtOnce = 4;
  for (int q = 0; q < kTileQueries; q += kQueriesAtOnce) {
    __m256i sums[kQueriesAtOnce][2] = {};
    for (int d = 0; d < tile_dim; d += kTogether) {
      const auto* rows = reinterpret_cast<const __m256i*>(block + d * kTileRows);
      const __m256i low = _mm256_loadu_si256(rows);
      const __m256i high = _mm256_loadu_si256(rows + 1);
      for (int i = 0; i < kQueriesAtOnce; ++i) {
        const __m256i pair = _mm256_set1_epi32(Pair(queries + (q + i) * tile_dim + d));
        sums[i][0] = _mm256_add_epi32(sums[i][0], _mm256_madd_epi16(low, pair));
        sums[i][1] = _mm256_add_epi32(sums[i][1], _mm256_madd_epi16(high, pair));
      }
    }
    std::memcpy(products + q * kTileRows, sums, sizeof(sums));
  }
}

[[gnu::target("avx512f,avx512bw")]] void TileAvx512(const std::int16_t* queries,
                                                    const std::int16_t* block, int tile_dim,
                                                    std::int32_t* products) {
  __m512i sums[kTileQueries] = {};
  for (int d = 0; d < tile_dim; d += kTogether) {
    const __m512i rows = _mm512_loadu_si512(block + d * kTileRows);
    for (int i = 0; i < kTileQueries; ++i) {
      const __m512i pair = _mm512_set1_epi32(Pair(queries + i * tile_dim + d));
      sums[i] = _mm512_add_epi32(sums[i], _mm512_madd_epi16(rows, pair));
    }
  }
  std::memcpy(products, sums, sizeof(sums));
}

#else

constexpr int kTogether = 1;

using Words [[gnu::vector_size(4 * sizeof(std::int32_t))]] = std::int32_t;
using Halves [[gnu::vector_size(4 * sizeof(std::int16_t))]] = std::int16_t;

void TilePlain(const std::int16_t* queries, const std::int16_t* block, int tile_dim,
               std::int32_t* products) {
  constexpr int kQueriesAtOnce = 4;  // of the 32 registers of 64-bit ARM
  constexpr int kVectors = 4;
  for (int q = 0; q < kTileQueries; q += kQueriesAtOnce) {
    Words sums[kQueriesAtOnce][kVectors] = {};
    for (int d = 0; d < tile_dim; ++d) {
      Halves halves[kVectors];
      std::memcpy(halves, block + d * kTileRows, sizeof(halves));
      for (int v = 0; v < kVectors; ++v) {
        const Words rows = __builtin_convertvector(halves[v], Words);
        for (int i = 0; i < kQueriesAtOnce; ++i) {
          sums[i][v] += rows * std::int32_t{queries[(q + i) * tile_dim + d]};
        }
      }
    }
    std::memcpy(products + q * kTileRows, sums, sizeof(sums));
  }
}

#endif

}  // namespace

void PackQuery(std::span<const std::int8_t> descriptor, std::int16_t* query) {
  const std::size_t dim = descriptor.size();
  for (std::size_t d = 0; d < dim; ++d) query[d] = descriptor[d];
  if (dim % 2 != 0) query[dim] = 0;
}

void PackRow(std::span<const std::int8_t> descriptor, int row, std::int16_t* block) {
  const int dim = static_cast<int>(descriptor.size());
  for (int d = 0; d < TileDim(dim); ++d) {
    std::int16_t* const together = block + d / kTogether * kTogether * kTileRows;
    together[row * kTogether + d % kTogether] = d < dim ? descriptor[d] : std::int16_t{0};
  }
}

#if defined(__x86_64__)
DotTile DotTileFor(CpuPath path) {
  switch (path) {
    case CpuPath::kAvx512:
      return TileAvx512;
    case CpuPath::kAvx2:
      return TileAvx2;
    case CpuPath::kPlain:
      break;
  }
  return TileSse2;
}
#else
DotTile DotTileFor(CpuPath) { return TilePlain; }
#endif

}  // namespace viewfix
