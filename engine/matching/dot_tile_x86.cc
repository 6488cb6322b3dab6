// SPDX-License-Identifier: BSD-3-Clause
#if defined(__x86_64__)

#include <immintrin.h>

#include <cstring>

#include "engine/matching/dot_tile_kernels.h"

namespace viewfix {
namespace {

// x86 multiplies pairs of 16-bit numbers and adds the two products at once; where it has VNNI,
// four bytes by four bytes.
constexpr int kWideTogether = 2;
constexpr int kVnniOffset = 128;  // VNNI multiplies unsigned bytes by signed ones

constexpr std::size_t WideBlockBytes(int depth) { return std::size_t{kTileRows} * 2 * depth; }

// Of query q, at value d.
int PairAt(const std::uint8_t* queries, int q, int d) {
  return FourBytes(queries + 2 * d * kTileQueries + q * 4);
}

void ProductsSse2(const std::uint8_t* queries, const std::uint8_t* block, int depth,
                  std::int32_t* products, std::size_t stride) {
  constexpr int kQueriesAtOnce = 2;  // of the 16 registers
  constexpr int kVectors = 4;
  for (int q = 0; q < kTileQueries; q += kQueriesAtOnce) {
    __m128i sums[kQueriesAtOnce][kVectors] = {};
    for (int d = 0; d < depth; d += kWideTogether) {
      const auto* rows = reinterpret_cast<const __m128i*>(block + 2 * d * kTileRows);
      for (int i = 0; i < kQueriesAtOnce; ++i) {
        const __m128i pair = _mm_set1_epi32(PairAt(queries, q + i, d));
        for (int v = 0; v < kVectors; ++v) {
          const __m128i product = _mm_madd_epi16(_mm_loadu_si128(rows + v), pair);
          sums[i][v] = _mm_add_epi32(sums[i][v], product);
        }
      }
    }
    for (int i = 0; i < kQueriesAtOnce; ++i) {
      std::memcpy(products + (q + i) * stride, sums[i], sizeof(sums[i]));
    }
  }
}

constexpr int kShortTogether = 2;
constexpr int kShortCopies = 2;  // of a query's pair: 32 bits are copied to all lanes at once

constexpr std::size_t kShortTail = sizeof(__m256i);  // blocks stay aligned as the first one is

constexpr std::size_t ShortTileEnd(int depth) {
  return std::size_t{kTileQueries} * kShortCopies * depth;
}
constexpr std::size_t ShortBlockEnd(int depth) { return std::size_t{kTileRows} * depth; }
constexpr std::size_t ShortBlockBytes(int depth) { return ShortBlockEnd(depth) + kShortTail; }

// Of half a tile; each lane is a row's.
struct ShortSums {
  __m256i of_query[kHalfTile];
};

// |r| sign(r) q = r q, with what is multiplied unsigned as maddubs wants it.
[[gnu::target("avx2")]] inline __m256i ShortProducts(__m256i magnitudes, __m256i rows,
                                                     const std::uint8_t* pair) {
  const __m256i values = _mm256_set1_epi32(FourBytes(pair));
  return _mm256_maddubs_epi16(magnitudes, _mm256_sign_epi8(values, rows));
}

// The first step fills the sums: cleared ones GCC 12 would clear in memory.
[[gnu::target("avx2")]] inline ShortSums SumShort(const std::uint8_t* half_tile,
                                                  const std::uint8_t* block, int depth) {
  ShortSums sums;
  const __m256i first_rows = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(block));
  const __m256i first_magnitudes = _mm256_abs_epi8(first_rows);
  for (int i = 0; i < kHalfTile; ++i) {
    sums.of_query[i] = ShortProducts(first_magnitudes, first_rows, half_tile + 4 * i);
  }
  for (int d = kShortTogether; d < depth; d += kShortTogether) {
    const __m256i rows =
        _mm256_loadu_si256(reinterpret_cast<const __m256i*>(block + d * kTileRows));
    const __m256i magnitudes = _mm256_abs_epi8(rows);
    const std::uint8_t* const pairs = half_tile + d * kShortCopies * kTileQueries;
    for (int i = 0; i < kHalfTile; ++i) {
      sums.of_query[i] =
          _mm256_add_epi16(sums.of_query[i], ShortProducts(magnitudes, rows, pairs + 4 * i));
    }
  }
  return sums;
}

[[gnu::target("avx2")]] inline __m256i Widen(__m256i sums, int half) {
  return _mm256_cvtepi16_epi32(half == 0 ? _mm256_castsi256_si128(sums)
                                         : _mm256_extracti128_si256(sums, 1));
}

// Where they would not fit: sums of 32 bits.
[[gnu::target("avx2")]] void SumWide(const std::uint8_t* half_tile, const std::uint8_t* block,
                                     int depth, std::int32_t* products, std::size_t stride) {
  constexpr int kQueriesAtOnce = 4;
  for (int q = 0; q < kHalfTile; q += kQueriesAtOnce) {
    __m256i sums[kQueriesAtOnce][2] = {};
    for (int d = 0; d < depth; d += kShortTogether) {
      const auto* const bytes = reinterpret_cast<const __m128i*>(block + d * kTileRows);
      const __m256i low = _mm256_cvtepi8_epi16(_mm_loadu_si128(bytes));
      const __m256i high = _mm256_cvtepi8_epi16(_mm_loadu_si128(bytes + 1));
      const std::uint8_t* const pairs = half_tile + d * kShortCopies * kTileQueries;
      for (int i = 0; i < kQueriesAtOnce; ++i) {
        const __m256i pair = _mm256_cvtepi8_epi16(_mm_set1_epi32(FourBytes(pairs + 4 * (q + i))));
        sums[i][0] = _mm256_add_epi32(sums[i][0], _mm256_madd_epi16(low, pair));
        sums[i][1] = _mm256_add_epi32(sums[i][1], _mm256_madd_epi16(high, pair));
      }
    }
    for (int i = 0; i < kQueriesAtOnce; ++i) {
      std::memcpy(products + (q + i) * stride, sums[i], sizeof(sums[i]));
    }
  }
}

// The halves of a tile: where their pairs begin, and their longest queries.
struct Halves {
  const std::uint8_t* pairs[2];
  std::int32_t longest2[2];
};

Halves HalvesOf(const std::uint8_t* tile, int depth) {
  Halves halves;
  for (int half = 0; half < 2; ++half) {
    const int first = half * kHalfTile;
    halves.pairs[half] = tile + first * kShortTogether * kShortCopies;
    halves.longest2[half] =
        LongestQuery(tile + ShortTileEnd(depth) + first * sizeof(std::int32_t), kHalfTile);
  }
  return halves;
}

[[gnu::target("avx2")]] void ProductsAvx2(const std::uint8_t* queries, const std::uint8_t* block,
                                          int depth, std::int32_t* products, std::size_t stride) {
  const Halves halves = HalvesOf(queries, depth);
  const std::int32_t longest_row2 = FourBytes(block + ShortBlockEnd(depth));
  for (int half = 0; half < 2; ++half, products += kHalfTile * stride) {
    if (!FitShort(halves.longest2[half], longest_row2)) {
      SumWide(halves.pairs[half], block, depth, products, stride);
      continue;
    }
    const ShortSums sums = SumShort(halves.pairs[half], block, depth);
    for (int i = 0; i < kHalfTile; ++i) {
      auto* const out = reinterpret_cast<__m256i*>(products + i * stride);
      _mm256_storeu_si256(out, Widen(sums.of_query[i], 0));
      _mm256_storeu_si256(out + 1, Widen(sums.of_query[i], 1));
    }
  }
}

// Writes the likeness of a query's rows where any is above its limit; returns which are.
[[gnu::target("avx2")]] inline std::uint32_t WriteLikeness(__m256i sums, const std::int32_t* norm2,
                                                           std::int32_t limit,
                                                           std::int32_t* likeness) {
  std::uint32_t above = 0;
  for (int half = 0; half < 2; ++half) {
    const __m256i sum = Widen(sums, half);
    const __m256i norms = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(norm2) + half);
    const __m256i like = _mm256_sub_epi32(_mm256_add_epi32(sum, sum), norms);
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(likeness) + half, like);
    const __m256i is_above = _mm256_cmpgt_epi32(like, _mm256_set1_epi32(limit));
    above |= static_cast<std::uint32_t>(_mm256_movemask_ps(_mm256_castsi256_ps(is_above)))
             << (8 * half);
  }
  return above;
}

// Half of each norm, rounded down, cut to 16 bits.
[[gnu::target("avx2")]] inline __m256i HalfNorms(const std::int32_t* norm2) {
  const auto* const norms = reinterpret_cast<const __m256i*>(norm2);
  const __m256i packed = _mm256_packs_epi32(_mm256_srli_epi32(_mm256_loadu_si256(norms), 1),
                                            _mm256_srli_epi32(_mm256_loadu_si256(norms + 1), 1));
  return _mm256_permute4x64_epi64(packed, 0b11'01'10'00);
}

// Of half a tile: limits, likeness, above.
[[gnu::target("avx2")]] bool CompareShort(const std::uint8_t* half_tile, const std::uint8_t* block,
                                          int depth, const std::int32_t* norm2,
                                          const std::int32_t* limits,
                                          std::int32_t (*likeness)[kTileRows],
                                          std::uint32_t* above) {
  const ShortSums sums = SumShort(half_tile, block, depth);
  const __m256i half_norms = HalfNorms(norm2);
  const __m256i least = _mm256_set1_epi16(kLeastDifference);
  std::uint32_t any = 0;
  for (int i = 0; i < kHalfTile; ++i) {
    const __m256i difference =
        _mm256_max_epi16(_mm256_subs_epi16(sums.of_query[i], half_norms), least);
    const __m256i may_be = _mm256_cmpgt_epi16(difference, _mm256_set1_epi16(HalfLimit(limits[i])));
    above[i] = _mm256_testz_si256(may_be, may_be) != 0
                   ? 0
                   : WriteLikeness(sums.of_query[i], norm2, limits[i], likeness[i]);
    any |= above[i];
  }
  return any != 0;
}

[[gnu::target("avx2")]] int FindAboveAvx2(const std::uint8_t* queries,
                                          const DotTile::Blocks& blocks, int begin, int depth,
                                          const std::int32_t* limits, DotTile::Likeness& likeness) {
  const Halves halves = HalvesOf(queries, depth);
  for (int b = begin; b < blocks.size; ++b) {
    const std::uint8_t* const block = blocks.rows + b * ShortBlockBytes(depth);
    const std::int32_t longest_row2 = FourBytes(block + ShortBlockEnd(depth));
    const std::int32_t* const norm2 = blocks.norm2 + b * kTileRows;
    bool any = false;
    for (int half = 0; half < 2; ++half) {
      const int first = half * kHalfTile;
      if (FitShort(halves.longest2[half], longest_row2)) {
        any |= CompareShort(halves.pairs[half], block, depth, norm2, limits + first,
                            likeness.of_query + first, likeness.above + first);
      } else {
        SumWide(halves.pairs[half], block, depth, likeness.of_query[first], kTileRows);
        CompareKernel::Run(norm2, limits, first, first + kHalfTile, &likeness, &any);
      }
    }
    if (any) return b;
  }
  return blocks.size;
}

struct TileSums {
  __m512i of_query[kTileQueries];
};

// The first step fills the sums: cleared ones GCC 12 would clear in memory.
[[gnu::target("avx512f,avx512bw")]] inline TileSums SumPairs512(const std::uint8_t* queries,
                                                                const std::uint8_t* block,
                                                                int depth) {
  TileSums sums;
  const __m512i first_rows = _mm512_loadu_si512(block);
  for (int i = 0; i < kTileQueries; ++i) {
    sums.of_query[i] = _mm512_madd_epi16(first_rows, _mm512_set1_epi32(PairAt(queries, i, 0)));
  }
  for (int d = kWideTogether; d < depth; d += kWideTogether) {
    const __m512i rows = _mm512_loadu_si512(block + 2 * d * kTileRows);
    for (int i = 0; i < kTileQueries; ++i) {
      const __m512i products = _mm512_madd_epi16(rows, _mm512_set1_epi32(PairAt(queries, i, d)));
      sums.of_query[i] = _mm512_add_epi32(sums.of_query[i], products);
    }
  }
  return sums;
}

[[gnu::target("avx512f,avx512bw")]] inline void WriteSums512(const TileSums& sums,
                                                             std::int32_t* products,
                                                             std::size_t stride) {
  for (int i = 0; i < kTileQueries; ++i) {
    _mm512_storeu_si512(products + i * stride, sums.of_query[i]);
  }
}

// Returns whether any is above its limit; only then the likeness is written.
[[gnu::target("avx512f,avx512bw")]] inline bool WriteLikeness512(const TileSums& sums,
                                                                 const std::int32_t* norm2,
                                                                 const std::int32_t* limits,
                                                                 DotTile::Likeness& likeness) {
  const __m512i norms = _mm512_loadu_si512(norm2);
  TileSums like;
  __mmask16 any = 0;
  for (int i = 0; i < kTileQueries; ++i) {
    const __m512i sum = sums.of_query[i];
    like.of_query[i] = _mm512_sub_epi32(_mm512_add_epi32(sum, sum), norms);
    const __mmask16 above = _mm512_cmpgt_epi32_mask(like.of_query[i], _mm512_set1_epi32(limits[i]));
    likeness.above[i] = above;
    any |= above;
  }
  if (any == 0) return false;
  std::memcpy(likeness.of_query, &like, sizeof(like));
  return true;
}

[[gnu::target("avx512f,avx512bw")]] void ProductsAvx512(const std::uint8_t* queries,
                                                        const std::uint8_t* block, int depth,
                                                        std::int32_t* products,
                                                        std::size_t stride) {
  WriteSums512(SumPairs512(queries, block, depth), products, stride);
}

[[gnu::target("avx512f,avx512bw")]] int FindAboveAvx512(const std::uint8_t* queries,
                                                        const DotTile::Blocks& blocks, int begin,
                                                        int depth, const std::int32_t* limits,
                                                        DotTile::Likeness& likeness) {
  for (int b = begin; b < blocks.size; ++b) {
    const TileSums sums = SumPairs512(queries, blocks.rows + b * WideBlockBytes(depth), depth);
    if (WriteLikeness512(sums, blocks.norm2 + b * kTileRows, limits, likeness)) return b;
  }
  return blocks.size;
}

#define VIEWFIX_VNNI "avx512f,avx512bw,avx512vnni"

// Rows' bytes are kVnniOffset too large; what the sums begin with takes it back.
[[gnu::target(VIEWFIX_VNNI)]] inline TileSums SumBytes512(const std::uint8_t* queries,
                                                          const std::uint8_t* block, int depth) {
  TileSums sums;
  for (int i = 0; i < kTileQueries; ++i) {
    sums.of_query[i] = _mm512_set1_epi32(FourBytes(queries + depth * kTileQueries + 4 * i));
  }
  for (int d = 0; d < depth; d += kBytesTogether) {
    const __m512i rows = _mm512_loadu_si512(block + d * kTileRows);
    for (int i = 0; i < kTileQueries; ++i) {
      const __m512i four = _mm512_set1_epi32(FourBytes(queries + d * kTileQueries + 4 * i));
      sums.of_query[i] = _mm512_dpbusd_epi32(sums.of_query[i], rows, four);
    }
  }
  return sums;
}

[[gnu::target(VIEWFIX_VNNI)]] void ProductsVnni(const std::uint8_t* queries,
                                                const std::uint8_t* block, int depth,
                                                std::int32_t* products, std::size_t stride) {
  WriteSums512(SumBytes512(queries, block, depth), products, stride);
}

[[gnu::target(VIEWFIX_VNNI)]] int FindAboveVnni(const std::uint8_t* queries,
                                                const DotTile::Blocks& blocks, int begin, int depth,
                                                const std::int32_t* limits,
                                                DotTile::Likeness& likeness) {
  for (int b = begin; b < blocks.size; ++b) {
    const TileSums sums =
        SumBytes512(queries, blocks.rows + std::size_t(b) * depth * kTileRows, depth);
    if (WriteLikeness512(sums, blocks.norm2 + b * kTileRows, limits, likeness)) return b;
  }
  return blocks.size;
}

}  // namespace

DotTile::Kernels DotTile::KernelsFor(CpuPath path) {
  Kernels k;
  switch (path) {
    case CpuPath::kAvx512Vnni:
      k.pack_query = k.pack_row = PackAs<std::uint8_t, kBytesTogether, 1>;
      k.together = kBytesTogether;
      k.value_bytes = 1;
      k.row_offset = kVnniOffset;
      k.products = ProductsVnni;
      k.find_above = FindAboveVnni;
      return k;
    case CpuPath::kAvx2:
      k.pack_query = PackAs<std::int8_t, kShortTogether, kShortCopies>;
      k.pack_row = PackAs<std::int8_t, kShortTogether, 1>;
      k.together = kShortTogether;
      k.value_bytes = 1;
      k.copies = kShortCopies;
      k.block_tail_bytes = kShortTail;
      k.products = ProductsAvx2;
      k.find_above = FindAboveAvx2;
      return k;
    default:
      k.pack_query = k.pack_row = PackAs<std::int16_t, kWideTogether, 1>;
      k.together = kWideTogether;
      k.value_bytes = 2;
      const bool wide512 = path == CpuPath::kAvx512;
      k.products = wide512 ? ProductsAvx512 : ProductsSse2;
      k.find_above = wide512 ? FindAboveAvx512 : FindAboveBy<ProductsSse2, WideBlockBytes>;
      return k;
  }
}

}  // namespace viewfix

#endif
