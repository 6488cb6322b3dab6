// SPDX-License-Identifier: BSD-3-Clause
#include "engine/matching/dot_tile.h"

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

// Values that lie together where they stay bytes, and what follows a query's: a 32-bit number that
// its sums begin with.
constexpr int kBytesTogether = 4;
constexpr int kByteQueryTail = 4;
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

void ProductsSse2(const std::uint8_t* queries, const std::uint8_t* block, int depth,
                  std::int32_t* products) {
  constexpr int kQueriesAtOnce = 2;  // of the 16 registers
  constexpr int kVectors = 4;
  for (int q = 0; q < kTileQueries; q += kQueriesAtOnce) {
    __m128i sums[kQueriesAtOnce][kVectors] = {};
    for (int d = 0; d < depth; d += kWideTogether) {
      const auto* rows = reinterpret_cast<const __m128i*>(block + 2 * d * kTileRows);
      for (int i = 0; i < kQueriesAtOnce; ++i) {
        const __m128i pair = _mm_set1_epi32(FourBytes(queries + 2 * ((q + i) * depth + d)));
        for (int v = 0; v < kVectors; ++v) {
          const __m128i product = _mm_madd_epi16(_mm_loadu_si128(rows + v), pair);
          sums[i][v] = _mm_add_epi32(sums[i][v], product);
        }
      }
    }
    std::memcpy(products + q * kTileRows, sums, sizeof(sums));
  }
}

[[gnu::target("avx2")]] void ProductsAvx2(const std::uint8_t* queries, const std::uint8_t* block,
                                          int depth, std::int32_t* products) {
  constexpr int kQueriesAtOnce = 4;
  for (int q = 0; q < kTileQueries; q += kQueriesAtOnce) {
    __m256i sums[kQueriesAtOnce][2] = {};
    for (int d = 0; d < depth; d += kWideTogether) {
      const auto* rows = reinterpret_cast<const __m256i*>(block + 2 * d * kTileRows);
      const __m256i low = _mm256_loadu_si256(rows);
      const __m256i high = _mm256_loadu_si256(rows + 1);
      for (int i = 0; i < kQueriesAtOnce; ++i) {
        const __m256i pair = _mm256_set1_epi32(FourBytes(queries + 2 * ((q + i) * depth + d)));
        sums[i][0] = _mm256_add_epi32(sums[i][0], _mm256_madd_epi16(low, pair));
        sums[i][1] = _mm256_add_epi32(sums[i][1], _mm256_madd_epi16(high, pair));
      }
    }
    std::memcpy(products + q * kTileRows, sums, sizeof(sums));
  }
}

struct TileSums {
  __m512i of_query[kTileQueries];
};

// What the pair of values at `query` and those of the rows beside them add to its sums.
[[gnu::target("avx512f,avx512bw")]] inline __m512i Pairs512(const std::uint8_t* query,
                                                            __m512i rows) {
  return _mm512_madd_epi16(rows, _mm512_set1_epi32(FourBytes(query)));
}

// The first step fills the sums: cleared ones GCC 12 would clear in memory.
[[gnu::target("avx512f,avx512bw")]] inline TileSums SumPairs512(const std::uint8_t* queries,
                                                                const std::uint8_t* block,
                                                                int depth) {
  TileSums sums;
  const __m512i first_rows = _mm512_loadu_si512(block);
  for (int i = 0; i < kTileQueries; ++i) {
    sums.of_query[i] = Pairs512(queries + 2 * i * depth, first_rows);
  }
  for (int d = kWideTogether; d < depth; d += kWideTogether) {
    const __m512i rows = _mm512_loadu_si512(block + 2 * d * kTileRows);
    for (int i = 0; i < kTileQueries; ++i) {
      const __m512i products = Pairs512(queries + 2 * (i * depth + d), rows);
      sums.of_query[i] = _mm512_add_epi32(sums.of_query[i], products);
    }
  }
  return sums;
}

[[gnu::target("avx512f,avx512bw")]] inline void WriteLikeness512(const TileSums& sums,
                                                                 const std::int32_t* norm2,
                                                                 const std::int32_t* limits,
                                                                 std::int32_t* likeness,
                                                                 std::uint32_t* above) {
  const __m512i norms = _mm512_loadu_si512(norm2);
  for (int i = 0; i < kTileQueries; ++i) {
    const __m512i sum = sums.of_query[i];
    const __m512i like = _mm512_sub_epi32(_mm512_add_epi32(sum, sum), norms);
    _mm512_storeu_si512(likeness + i * kTileRows, like);
    above[i] = _mm512_cmpgt_epi32_mask(like, _mm512_set1_epi32(limits[i]));
  }
}

[[gnu::target("avx512f,avx512bw")]] void ProductsAvx512(const std::uint8_t* queries,
                                                        const std::uint8_t* block, int depth,
                                                        std::int32_t* products) {
  const TileSums sums = SumPairs512(queries, block, depth);
  std::memcpy(products, &sums, sizeof(sums));
}

[[gnu::target("avx512f,avx512bw")]] void LikenessAvx512(
    const std::uint8_t* queries, const std::uint8_t* block, int depth, const std::int32_t* norm2,
    const std::int32_t* limits, std::int32_t* likeness, std::uint32_t* above) {
  WriteLikeness512(SumPairs512(queries, block, depth), norm2, limits, likeness, above);
}

#define VIEWFIX_VNNI "avx512f,avx512bw,avx512vnni"

// Rows' bytes are kRowOffset too large; what the sums begin with takes it back.
[[gnu::target(VIEWFIX_VNNI)]] inline TileSums SumBytes512(const std::uint8_t* queries,
                                                          const std::uint8_t* block, int depth) {
  const int stride = depth + kByteQueryTail;
  TileSums sums;
  for (int i = 0; i < kTileQueries; ++i) {
    sums.of_query[i] = _mm512_set1_epi32(FourBytes(queries + i * stride + depth));
  }
  for (int d = 0; d < depth; d += kBytesTogether) {
    const __m512i rows = _mm512_loadu_si512(block + d * kTileRows);
    for (int i = 0; i < kTileQueries; ++i) {
      const __m512i four = _mm512_set1_epi32(FourBytes(queries + i * stride + d));
      sums.of_query[i] = _mm512_dpbusd_epi32(sums.of_query[i], rows, four);
    }
  }
  return sums;
}

[[gnu::target(VIEWFIX_VNNI)]] void ProductsVnni(const std::uint8_t* queries,
                                                const std::uint8_t* block, int depth,
                                                std::int32_t* products) {
  const TileSums sums = SumBytes512(queries, block, depth);
  std::memcpy(products, &sums, sizeof(sums));
}

[[gnu::target(VIEWFIX_VNNI)]] void LikenessVnni(const std::uint8_t* queries,
                                                const std::uint8_t* block, int depth,
                                                const std::int32_t* norm2,
                                                const std::int32_t* limits, std::int32_t* likeness,
                                                std::uint32_t* above) {
  WriteLikeness512(SumBytes512(queries, block, depth), norm2, limits, likeness, above);
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
                   std::int32_t* products) {
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
          sums[i][v] += rows * WideValue(queries + 2 * ((q + i) * depth + d));
        }
      }
    }
    std::memcpy(products + q * kTileRows, sums, sizeof(sums));
  }
}

#ifdef VIEWFIX_NEON_DOT

// The dot product instructions of ARMv8.2 (Cortex-A55, A75 and later): four signed bytes by four.
[[gnu::target("arch=armv8.2-a+dotprod")]] void ProductsNeonDot(const std::uint8_t* queries,
                                                               const std::uint8_t* block, int depth,
                                                               std::int32_t* products) {
  constexpr int kQueriesAtOnce = 4;  // of the 32 registers
  constexpr int kVectors = 4;
  const int stride = depth + kByteQueryTail;
  for (int q = 0; q < kTileQueries; q += kQueriesAtOnce) {
    int32x4_t sums[kQueriesAtOnce][kVectors] = {};
    for (int d = 0; d < depth; d += kBytesTogether) {
      int8x16_t rows[kVectors];
      for (int v = 0; v < kVectors; ++v) {
        rows[v] = vreinterpretq_s8_u8(vld1q_u8(block + d * kTileRows + 16 * v));
      }
      for (int i = 0; i < kQueriesAtOnce; ++i) {
        std::int32_t four;
        std::memcpy(&four, queries + (q + i) * stride + d, sizeof(four));
        const int8x16_t values = vreinterpretq_s8_s32(vdupq_n_s32(four));
        for (int v = 0; v < kVectors; ++v) sums[i][v] = vdotq_s32(sums[i][v], rows[v], values);
      }
    }
    for (int i = 0; i < kQueriesAtOnce; ++i) {
      for (int v = 0; v < kVectors; ++v) {
        vst1q_s32(products + (q + i) * kTileRows + 4 * v, sums[i][v]);
      }
    }
  }
}

#endif

#endif

// On the paths without compare masks. Most rows are below the limits, which whole vectors see at
// once.
struct CompareKernel {
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

template <auto kProducts, CpuPath kPath>
void LikenessOn(const std::uint8_t* queries, const std::uint8_t* block, int depth,
                const std::int32_t* norm2, const std::int32_t* limits, std::int32_t* likeness,
                std::uint32_t* above) {
  kProducts(queries, block, depth, likeness);
  RunOnPath<CompareKernel>(kPath, norm2, limits, likeness, above);
}

constexpr int RoundUp(int n, int step) { return (n + step - 1) / step * step; }

}  // namespace

#if defined(__x86_64__)
DotTile::Kernels DotTile::KernelsFor(CpuPath path) {
  switch (path) {
    case CpuPath::kAvx512Vnni:
      return {ProductsVnni, LikenessVnni};
    case CpuPath::kAvx512:
      return {ProductsAvx512, LikenessAvx512};
    case CpuPath::kAvx2:
      return {ProductsAvx2, LikenessOn<ProductsAvx2, CpuPath::kAvx2>};
    default:
      return {ProductsSse2, LikenessOn<ProductsSse2, CpuPath::kPlain>};
  }
}
#else
DotTile::Kernels DotTile::KernelsFor([[maybe_unused]] CpuPath path) {
#ifdef VIEWFIX_NEON_DOT
  if (path == CpuPath::kNeonDot) {
    return {ProductsNeonDot, LikenessOn<ProductsNeonDot, CpuPath::kPlain>};
  }
#endif
  return {ProductsPlain, LikenessOn<ProductsPlain, CpuPath::kPlain>};
}
#endif

DotTile::DotTile(int dim, CpuPath path)
    : bytes_(path == CpuPath::kAvx512Vnni || path == CpuPath::kNeonDot),
      depth_(RoundUp(dim, bytes_ ? kBytesTogether : kWideTogether)),
      query_bytes_(bytes_ ? depth_ + kByteQueryTail : 2 * depth_),
      block_bytes_(std::size_t{kTileRows} * depth_ * (bytes_ ? 1 : 2)),
      kernels_(KernelsFor(path)) {
  assert(dim >= 1 && dim <= kMaxDescriptorDim);
}

void DotTile::PackQuery(std::span<const std::int8_t> descriptor, std::uint8_t* query) const {
  std::memset(query, 0, query_bytes_);
  if (!bytes_) {
    for (const std::int16_t value : descriptor) {
      std::memcpy(query, &value, sizeof(value));
      query += sizeof(value);
    }
    return;
  }
  std::memcpy(query, descriptor.data(), descriptor.size());
  const std::int32_t tail =
      -kRowOffset * std::accumulate(descriptor.begin(), descriptor.end(), std::int32_t{0});
  std::memcpy(query + depth_, &tail, sizeof(tail));
}

void DotTile::PackRow(std::span<const std::int8_t> descriptor, int row, std::uint8_t* block) const {
  const int dim = static_cast<int>(descriptor.size());
  const int together = bytes_ ? kBytesTogether : kWideTogether;
  for (int d = 0; d < depth_; ++d) {
    const int value = d < dim ? descriptor[d] : 0;
    const int place = (d / together * kTileRows + row) * together + d % together;
    if (bytes_) {
      block[place] = static_cast<std::uint8_t>(value + kRowOffset);
    } else {
      const auto wide = static_cast<std::int16_t>(value);
      std::memcpy(block + 2 * place, &wide, sizeof(wide));
    }
  }
}

}  // namespace viewfix
