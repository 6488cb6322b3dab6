// SPDX-License-Identifier: BSD-3-Clause
#include "engine/matching/dot_tile.h"

#include <array>
#include <cassert>
#include <cstring>
#include <numeric>

#if defined(__x86_64__)
#include <immintrin.h>
#elif defined(VIEWFIX_NEON_DOT)
#include <arm_neon.h>
#endif

namespace viewfix {
namespace {

static_assert(kTileQueries == kTileRows);  // a tile and a block lie alike
// Values that lie together where they stay bytes. A tile ends with 32-bit numbers there, which on
// x86 its queries' sums begin with.
constexpr int kBytesTogether = 4;
#if defined(__x86_64__)
constexpr int kRowOffset = 128;  // VNNI multiplies unsigned bytes by signed ones
#else
constexpr int kRowOffset = 0;
#endif

#if defined(__x86_64__)

// x86 multiplies pairs of 16-bit numbers and adds the two products at once; where it has VNNI,
// four bytes by four bytes.
constexpr int kWideTogether = 2;

int FourBytes(const std::uint8_t* values) {
  int four;
  std::memcpy(&four, values, sizeof(four));
  return four;
}

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

[[gnu::target("avx2")]] void ProductsAvx2(const std::uint8_t* queries, const std::uint8_t* block,
                                          int depth, std::int32_t* products, std::size_t stride) {
  constexpr int kQueriesAtOnce = 4;
  for (int q = 0; q < kTileQueries; q += kQueriesAtOnce) {
    __m256i sums[kQueriesAtOnce][2] = {};
    for (int d = 0; d < depth; d += kWideTogether) {
      const auto* rows = reinterpret_cast<const __m256i*>(block + 2 * d * kTileRows);
      const __m256i low = _mm256_loadu_si256(rows);
      const __m256i high = _mm256_loadu_si256(rows + 1);
      for (int i = 0; i < kQueriesAtOnce; ++i) {
        const __m256i pair = _mm256_set1_epi32(PairAt(queries, q + i, d));
        sums[i][0] = _mm256_add_epi32(sums[i][0], _mm256_madd_epi16(low, pair));
        sums[i][1] = _mm256_add_epi32(sums[i][1], _mm256_madd_epi16(high, pair));
      }
    }
    for (int i = 0; i < kQueriesAtOnce; ++i) {
      std::memcpy(products + (q + i) * stride, sums[i], sizeof(sums[i]));
    }
  }
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
    const TileSums sums =
        SumPairs512(queries, blocks.rows + std::size_t(b) * 2 * depth * kTileRows, depth);
    if (WriteLikeness512(sums, blocks.norm2 + b * kTileRows, limits, likeness)) return b;
  }
  return blocks.size;
}

#define VIEWFIX_VNNI "avx512f,avx512bw,avx512vnni"

// Rows' bytes are kRowOffset too large; what the sums begin with takes it back.
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

#else

constexpr int kWideTogether = 1;

using Words [[gnu::vector_size(4 * sizeof(std::int32_t))]] = std::int32_t;
using Halves [[gnu::vector_size(4 * sizeof(std::int16_t))]] = std::int16_t;

std::int32_t WideValue(const std::uint8_t* bytes) {
  std::int16_t value;
  std::memcpy(&value, bytes, sizeof(value));
  return value;
}

void ProductsPlain(const std::uint8_t* queries, const std::uint8_t* block, int depth,
                   std::int32_t* products, std::size_t stride) {
  constexpr int kQueriesAtOnce = 4;  // of the 32 registers of 64-bit ARM
  constexpr int kVectors = 4;
  for (int q = 0; q < kTileQueries; q += kQueriesAtOnce) {
    Words sums[kQueriesAtOnce][kVectors] = {};
    for (int d = 0; d < depth; ++d) {
      Halves halves[kVectors];
      std::memcpy(halves, block + 2 * d * kTileRows, sizeof(halves));
      for (int v = 0; v < kVectors; ++v) {
        const Words rows = __builtin_convertvector(halves[v], Words);
        for (int i = 0; i < kQueriesAtOnce; ++i) {
          sums[i][v] += rows * WideValue(queries + 2 * (d * kTileQueries + q + i));
        }
      }
    }
    for (int i = 0; i < kQueriesAtOnce; ++i) {
      std::memcpy(products + (q + i) * stride, sums[i], sizeof(sums[i]));
    }
  }
}

#ifdef VIEWFIX_NEON_DOT

// The dot product instructions of ARMv8.2 (Cortex-A55, A75 and later): four signed bytes by four.
[[gnu::target("arch=armv8.2-a+dotprod")]] void ProductsNeonDot(const std::uint8_t* queries,
                                                               const std::uint8_t* block, int depth,
                                                               std::int32_t* products,
                                                               std::size_t stride) {
  constexpr int kQueriesAtOnce = 4;  // of the 32 registers
  constexpr int kVectors = 4;
  for (int q = 0; q < kTileQueries; q += kQueriesAtOnce) {
    int32x4_t sums[kQueriesAtOnce][kVectors] = {};
    for (int d = 0; d < depth; d += kBytesTogether) {
      int8x16_t rows[kVectors];
      for (int v = 0; v < kVectors; ++v) {
        rows[v] = vreinterpretq_s8_u8(vld1q_u8(block + d * kTileRows + 16 * v));
      }
      for (int i = 0; i < kQueriesAtOnce; ++i) {
        std::int32_t four;
        std::memcpy(&four, queries + d * kTileQueries + 4 * (q + i), sizeof(four));
        const int8x16_t values = vreinterpretq_s8_s32(vdupq_n_s32(four));
        for (int v = 0; v < kVectors; ++v) sums[i][v] = vdotq_s32(sums[i][v], rows[v], values);
      }
    }
    for (int i = 0; i < kQueriesAtOnce; ++i) {
      for (int v = 0; v < kVectors; ++v) {
        vst1q_s32(products + (q + i) * stride + 4 * v, sums[i][v]);
      }
    }
  }
}

#endif

#endif

// On the paths without compare masks: products become likeness. Returns whether any is above its
// limit. Most rows are not, which whole vectors see at once.
struct CompareKernel {
  VIEWFIX_KERNEL void Run(const std::int32_t* norm2, const std::int32_t* limits,
                          DotTile::Likeness* likeness, bool* any) {
    for (int i = 0; i < kTileQueries; ++i) {
      std::int32_t* const like = likeness->of_query[i];
      int some = 0;
      for (int r = 0; r < kTileRows; ++r) {
        like[r] = 2 * like[r] - norm2[r];
        some |= like[r] > limits[i] ? 1 : 0;
      }
      likeness->above[i] = 0;
      if (some == 0) continue;
      for (int r = 0; r < kTileRows; ++r) likeness->above[i] |= like[r] > limits[i] ? 1U << r : 0U;
      *any = true;
    }
  }
};

template <auto kProducts, CpuPath kPath, int kBytesOfValue>
int FindAboveOn(const std::uint8_t* queries, const DotTile::Blocks& blocks, int begin, int depth,
                const std::int32_t* limits, DotTile::Likeness& likeness) {
  const std::size_t block_bytes = std::size_t{kTileRows} * kBytesOfValue * depth;
  for (int b = begin; b < blocks.size; ++b) {
    kProducts(queries, blocks.rows + b * block_bytes, depth, likeness.of_query[0], kTileRows);
    bool any = false;
    RunOnPath<CompareKernel>(kPath, blocks.norm2 + b * kTileRows, limits, &likeness, &any);
    if (any) return b;
  }
  return blocks.size;
}

constexpr int RoundUp(int n, int step) { return (n + step - 1) / step * step; }

}  // namespace

#if defined(__x86_64__)
DotTile::Kernels DotTile::KernelsFor(CpuPath path) {
  switch (path) {
    case CpuPath::kAvx512Vnni:
      return {ProductsVnni, FindAboveVnni};
    case CpuPath::kAvx512:
      return {ProductsAvx512, FindAboveAvx512};
    case CpuPath::kAvx2:
      return {ProductsAvx2, FindAboveOn<ProductsAvx2, CpuPath::kAvx2, 2>};
    default:
      return {ProductsSse2, FindAboveOn<ProductsSse2, CpuPath::kPlain, 2>};
  }
}
#else
DotTile::Kernels DotTile::KernelsFor([[maybe_unused]] CpuPath path) {
#ifdef VIEWFIX_NEON_DOT
  if (path == CpuPath::kNeonDot) {
    return {ProductsNeonDot, FindAboveOn<ProductsNeonDot, CpuPath::kPlain, 1>};
  }
#endif
  return {ProductsPlain, FindAboveOn<ProductsPlain, CpuPath::kPlain, 2>};
}
#endif

DotTile::DotTile(int dim, CpuPath path)
    : dim_(dim),
      bytes_(path == CpuPath::kAvx512Vnni || path == CpuPath::kNeonDot),
      depth_(RoundUp(dim, bytes_ ? kBytesTogether : kWideTogether)),
      tile_bytes_(std::size_t{kTileQueries} *
                  (bytes_ ? depth_ + sizeof(std::int32_t) : 2 * depth_)),
      block_bytes_(std::size_t{kTileRows} * depth_ * (bytes_ ? 1 : 2)),
      kernels_(KernelsFor(path)) {
  assert(dim >= 1 && dim <= kMaxDescriptorDim);
}

void DotTile::PackQuery(std::span<const std::int8_t> descriptor, int query,
                        std::uint8_t* tile) const {
  Pack(descriptor, query, 0, tile);
  if (!bytes_) return;
  const std::int32_t first =
      -kRowOffset * std::accumulate(descriptor.begin(), descriptor.end(), std::int32_t{0});
  std::memcpy(tile + depth_ * kTileQueries + sizeof(first) * query, &first, sizeof(first));
}

void DotTile::PackQueries(std::span<const std::int8_t> descriptors, std::uint8_t* tile) const {
  const int n = static_cast<int>(descriptors.size()) / dim_;
  assert(n <= kTileQueries);
  for (int i = 0; i < n; ++i) PackQuery(descriptors.subspan(std::size_t(i) * dim_, dim_), i, tile);
}

void DotTile::PackRow(std::span<const std::int8_t> descriptor, int row, std::uint8_t* block) const {
  Pack(descriptor, row, bytes_ ? kRowOffset : 0, block);
}

// As number `i` of a tile or a block, `offset` added to each value.
void DotTile::Pack(std::span<const std::int8_t> descriptor, int i, int offset,
                   std::uint8_t* packed) const {
  const int dim = static_cast<int>(descriptor.size());
  const auto value_at = [&](int d) { return (d < dim ? descriptor[d] : 0) + offset; };
  if (bytes_) {
    for (int d = 0; d < depth_; d += kBytesTogether) {
      std::array<std::uint8_t, kBytesTogether> values;
      for (int j = 0; j < kBytesTogether; ++j) {
        values[j] = static_cast<std::uint8_t>(value_at(d + j));
      }
      std::memcpy(packed + (d * kTileRows + i * kBytesTogether), values.data(), sizeof(values));
    }
    return;
  }
  for (int d = 0; d < depth_; d += kWideTogether) {
    std::array<std::int16_t, kWideTogether> values;
    for (int j = 0; j < kWideTogether; ++j) values[j] = static_cast<std::int16_t>(value_at(d + j));
    std::memcpy(packed + 2 * (d * kTileRows + i * kWideTogether), values.data(), sizeof(values));
  }
}

}  // namespace viewfix
