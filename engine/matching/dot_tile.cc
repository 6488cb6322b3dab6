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

// What the values at `query` and those of the rows beside them add to its sums.
[[gnu::target("avx512f,avx512bw")]] inline __m512i Products512(const std::int16_t* query,
                                                               __m512i rows) {
  return _mm512_madd_epi16(rows, _mm512_set1_epi32(Pair(query)));
}

struct TileSums {
  __m512i of_query[kTileQueries];
};

// The first step fills the sums: cleared ones GCC 12 would clear in memory.
[[gnu::target("avx512f,avx512bw")]] inline TileSums SumTileAvx512(const std::int16_t* queries,
                                                                  const std::int16_t* block,
                                                                  int tile_dim) {
  TileSums sums;
  const __m512i first_rows = _mm512_loadu_si512(block);
  for (int i = 0; i < kTileQueries; ++i) {
    sums.of_query[i] = Products512(queries + i * tile_dim, first_rows);
  }
  for (int d = kTogether; d < tile_dim; d += kTogether) {
    const __m512i rows = _mm512_loadu_si512(block + d * kTileRows);
    for (int i = 0; i < kTileQueries; ++i) {
      const __m512i products = Products512(queries + i * tile_dim + d, rows);
      sums.of_query[i] = _mm512_add_epi32(sums.of_query[i], products);
    }
  }
  return sums;
}

[[gnu::target("avx512f,avx512bw")]] void TileAvx512(const std::int16_t* queries,
                                                    const std::int16_t* block, int tile_dim,
                                                    std::int32_t* products) {
  const TileSums sums = SumTileAvx512(queries, block, tile_dim);
  std::memcpy(products, &sums, sizeof(sums));
}

[[gnu::target("avx512f,avx512bw")]] void LikenessAvx512(
    const std::int16_t* queries, const std::int16_t* block, int tile_dim, const std::int32_t* norm2,
    const std::int32_t* limits, std::int32_t* likeness, std::uint32_t* above) {
  const TileSums sums = SumTileAvx512(queries, block, tile_dim);
  const __m512i norms = _mm512_loadu_si512(norm2);
  for (int i = 0; i < kTileQueries; ++i) {
    const __m512i sum = sums.of_query[i];
    const __m512i like = _mm512_sub_epi32(_mm512_add_epi32(sum, sum), norms);
    _mm512_storeu_si512(likeness + i * kTileRows, like);
    above[i] = _mm512_cmpgt_epi32_mask(like, _mm512_set1_epi32(limits[i]));
  }
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

// On the paths without compare masks. Most rows are below the limits, which whole vectors see at
// once.
struct LikenessKernel {
  VIEWFIX_KERNEL void Run(const std::int32_t* norm2, const std::int32_t* limits,
                          std::int32_t* likeness, std::uint32_t* above) {
    for (int i = 0; i < kTileQueries; ++i, likeness += kTileRows) {
      int some = 0;
      for (int r = 0; r < kTileRows; ++r) {
        likeness[r] = 2 * likeness[r] - norm2[r];
        some |= likeness[r] > limits[i] ? 1 : 0;
      }
      above[i] = 0;
      if (some == 0) continue;
      for (int r = 0; r < kTileRows; ++r) above[i] |= likeness[r] > limits[i] ? 1U << r : 0U;
    }
  }
};

template <CpuPath kPath>
void LikenessTileOn(const std::int16_t* queries, const std::int16_t* block, int tile_dim,
                    const std::int32_t* norm2, const std::int32_t* limits, std::int32_t* likeness,
                    std::uint32_t* above) {
  DotTileFor(kPath)(queries, block, tile_dim, likeness);
  RunOnPath<LikenessKernel>(kPath, norm2, limits, likeness, above);
}

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

LikenessTile LikenessTileFor(CpuPath path) {
  switch (path) {
    case CpuPath::kAvx512:
      return LikenessAvx512;
    case CpuPath::kAvx2:
      return LikenessTileOn<CpuPath::kAvx2>;
    case CpuPath::kPlain:
      break;
  }
  return LikenessTileOn<CpuPath::kPlain>;
}
#else
DotTile DotTileFor(CpuPath) { return TilePlain; }
LikenessTile LikenessTileFor(CpuPath) { return LikenessTileOn<CpuPath::kPlain>; }
#endif

}  // namespace viewfix
