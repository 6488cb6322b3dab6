// SPDX-License-Identifier: BSD-3-Clause
#if !defined(__x86_64__)

#include <cstring>
#include <utility>

#include "engine/matching/dot_tile_kernels.h"

#ifdef __aarch64__
#include <arm_neon.h>
#endif

namespace viewfix {
namespace {

std::int16_t WideValue(const std::uint8_t* bytes) {
  std::int16_t value;
  std::memcpy(&value, bytes, sizeof(value));
  return value;
}

#ifdef __aarch64__

constexpr std::size_t kTail = 16;  // of a block, whose longest row it tells; a whole vector

struct ShortSums {
  uint16x8_t low[kHalfTile];  // of the first eight rows
  uint16x8_t high[kHalfTile];
};

template <std::size_t... kQuery>
inline void AddProducts(uint16x8_t low, uint16x8_t high, uint16x8_t values, ShortSums& sums,
                        std::index_sequence<kQuery...>) {
  ((sums.low[kQuery] = vmlaq_laneq_u16(sums.low[kQuery], low, values, kQuery)), ...);
  ((sums.high[kQuery] = vmlaq_laneq_u16(sums.high[kQuery], high, values, kQuery)), ...);
}

// Of queries first .. first + 7.
void SumShort(const std::uint8_t* queries, const std::uint8_t* block, int depth, int first,
              std::int32_t* products, std::size_t stride) {
  ShortSums sums;
  for (int i = 0; i < kHalfTile; ++i) sums.low[i] = sums.high[i] = vdupq_n_u16(0);
  for (int d = 0; d < depth; ++d) {
    const auto load = [](const std::uint8_t* bytes) {
      return vreinterpretq_u16_u8(vld1q_u8(bytes));
    };
    const std::uint8_t* const rows = block + 2 * d * kTileRows;
    AddProducts(load(rows), load(rows + kTileRows), load(queries + 2 * (d * kTileQueries + first)),
                sums, std::make_index_sequence<kHalfTile>());
  }
  for (int i = 0; i < kHalfTile; ++i) {
    std::int32_t* out = products + (first + i) * stride;
    for (const uint16x8_t eight : {sums.low[i], sums.high[i]}) {
      const int16x8_t sum = vreinterpretq_s16_u16(eight);
      vst1q_s32(out, vmovl_s16(vget_low_s16(sum)));
      vst1q_s32(out + 4, vmovl_high_s16(sum));
      out += 8;
    }
  }
}

// The same where sums of 16 bits would not do.
void SumWide(const std::uint8_t* queries, const std::uint8_t* block, int depth, int first,
             std::int32_t* products, std::size_t stride) {
  constexpr int kQueriesAtOnce = 4;  // of the 32 registers
  constexpr int kVectors = 4;
  for (int q = first; q < first + kHalfTile; q += kQueriesAtOnce) {
    int32x4_t sums[kQueriesAtOnce][kVectors] = {};
    for (int d = 0; d < depth; ++d) {
      int16x4_t rows[kVectors];
      for (int v = 0; v < kVectors; ++v) {
        rows[v] = vreinterpret_s16_u8(vld1_u8(block + 2 * d * kTileRows + 8 * v));
      }
      for (int i = 0; i < kQueriesAtOnce; ++i) {
        const std::int16_t value = WideValue(queries + 2 * (d * kTileQueries + q + i));
        for (int v = 0; v < kVectors; ++v) sums[i][v] = vmlal_n_s16(sums[i][v], rows[v], value);
      }
    }
    for (int i = 0; i < kQueriesAtOnce; ++i) {
      for (int v = 0; v < kVectors; ++v) {
        vst1q_s32(products + (q + i) * stride + 4 * v, sums[i][v]);
      }
    }
  }
}

void ProductsPlain(const std::uint8_t* queries, const std::uint8_t* block, int depth,
                   std::int32_t* products, std::size_t stride) {
  const std::uint8_t* const lengths = queries + 2 * depth * kTileQueries;
  const std::int32_t longest_row2 = FourBytes(block + 2 * depth * kTileRows);
  for (int first = 0; first < kTileQueries; first += kHalfTile) {
    const std::int32_t longest2 = LongestQuery(lengths + 4 * first, kHalfTile);
    const auto sum = FitShort(longest2, longest_row2) ? SumShort : SumWide;
    sum(queries, block, depth, first, products, stride);
  }
}

#else

constexpr std::size_t kTail = 0;  // without vectors sums of 16 bits are no faster

void ProductsPlain(const std::uint8_t* queries, const std::uint8_t* block, int depth,
                   std::int32_t* products, std::size_t stride) {
  for (int q = 0; q < kTileQueries; ++q) {
    std::int32_t sums[kTileRows] = {};
    for (int d = 0; d < depth; ++d) {
      const std::int32_t value = WideValue(queries + 2 * (d * kTileQueries + q));
      for (int r = 0; r < kTileRows; ++r) {
        sums[r] += value * WideValue(block + 2 * (d * kTileRows + r));
      }
    }
    std::memcpy(products + q * stride, sums, sizeof(sums));
  }
}

#endif

constexpr std::size_t PlainBlockBytes(int depth) {
  return std::size_t{kTileRows} * 2 * depth + kTail;
}

#ifdef VIEWFIX_NEON_DOT

constexpr std::size_t NeonDotBlockBytes(int depth) { return std::size_t{kTileRows} * depth; }

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

}  // namespace

DotTile::Kernels DotTile::KernelsFor([[maybe_unused]] CpuPath path) {
  Kernels k;
#ifdef VIEWFIX_NEON_DOT
  if (path == CpuPath::kNeonDot) {
    k.pack_query = k.pack_row = PackAs<std::int8_t, kBytesTogether, 1>;
    k.together = kBytesTogether;
    k.value_bytes = 1;
    k.products = ProductsNeonDot;
    k.find_above = FindAboveBy<ProductsNeonDot, NeonDotBlockBytes>;
    return k;
  }
#endif
  k.pack_query = k.pack_row = PackAs<std::int16_t, 1, 1>;
  k.value_bytes = 2;
  k.lengths_bytes = kTail;
  k.products = ProductsPlain;
  k.find_above = FindAboveBy<ProductsPlain, PlainBlockBytes>;
  return k;
}

}  // namespace viewfix

#endif
