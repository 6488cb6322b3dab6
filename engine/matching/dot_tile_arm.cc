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

// Of one query with the rows of a block.
struct Products {
  int32x4_t of_rows[kTileRows / 4];
};

Products Load(const std::int32_t* values) {
  Products loaded;
  for (int v = 0; v < kTileRows / 4; ++v) loaded.of_rows[v] = vld1q_s32(values + 4 * v);
  return loaded;
}

// Writes the likeness of a query's rows; returns which are above its limit.
std::uint32_t WriteLikeness(const Products& products, const std::int32_t* norm2, std::int32_t limit,
                            std::int32_t* likeness) {
  uint32x4_t any = vdupq_n_u32(0);
  for (int v = 0; v < kTileRows / 4; ++v) {
    const int32x4_t like = vsubq_s32(vshlq_n_s32(products.of_rows[v], 1), vld1q_s32(norm2 + 4 * v));
    vst1q_s32(likeness + 4 * v, like);
    any = vorrq_u32(any, vcgtq_s32(like, vdupq_n_s32(limit)));
  }
  if (vmaxvq_u32(any) == 0) return 0;  // as nearly always
  std::uint32_t above = 0;
  for (int r = 0; r < kTileRows; ++r) above |= likeness[r] > limit ? 1U << r : 0U;
  return above;
}

// Of queries begin .. end - 1, whose products `likeness` holds: they become likeness. Returns
// whether any is above its limit.
bool CompareWide(const std::int32_t* norm2, const std::int32_t* limits, int begin, int end,
                 DotTile::Likeness& likeness) {
  std::uint32_t any = 0;
  for (int q = begin; q < end; ++q) {
    std::int32_t* const like = likeness.of_query[q];
    likeness.above[q] = WriteLikeness(Load(like), norm2, limits[q], like);
    any |= likeness.above[q];
  }
  return any != 0;
}

struct ShortSums {
  uint16x8_t low[kHalfTile];  // of the first eight rows
  uint16x8_t high[kHalfTile];
};

// sums + rows * values[kQuery]. A function of its own: clang's intrinsic is a macro.
template <int kQuery>
[[gnu::always_inline]] inline uint16x8_t AddProduct(uint16x8_t sums, uint16x8_t rows,
                                                    uint16x8_t values) {
  return vmlaq_laneq_u16(sums, rows, values, kQuery);
}

template <int... kQuery>
[[gnu::always_inline]] inline void AddProducts(uint16x8_t low, uint16x8_t high, uint16x8_t values,
                                               ShortSums& sums,
                                               std::integer_sequence<int, kQuery...>) {
  ((sums.low[kQuery] = AddProduct<kQuery>(sums.low[kQuery], low, values)), ...);
  ((sums.high[kQuery] = AddProduct<kQuery>(sums.high[kQuery], high, values)), ...);
}

// Of queries first .. first + 7: twice as many sums a vector.
ShortSums SumShort(const std::uint8_t* queries, const std::uint8_t* block, int depth, int first) {
  ShortSums sums;
  for (int i = 0; i < kHalfTile; ++i) sums.low[i] = sums.high[i] = vdupq_n_u16(0);
  for (int d = 0; d < depth; ++d) {
    const auto load = [](const std::uint8_t* bytes) {
      return vreinterpretq_u16_u8(vld1q_u8(bytes));
    };
    const std::uint8_t* const rows = block + 2 * d * kTileRows;
    AddProducts(load(rows), load(rows + kTileRows), load(queries + 2 * (d * kTileQueries + first)),
                sums, std::make_integer_sequence<int, kHalfTile>());
  }
  return sums;
}

// The sums of a query as 32-bit numbers.
Products ProductsOf(const ShortSums& sums, int i) {
  const int16x8_t low = vreinterpretq_s16_u16(sums.low[i]);
  const int16x8_t high = vreinterpretq_s16_u16(sums.high[i]);
  return {vmovl_s16(vget_low_s16(low)), vmovl_high_s16(low), vmovl_s16(vget_low_s16(high)),
          vmovl_high_s16(high)};
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

constexpr std::size_t PlainBlockBytes(int depth) {
  return std::size_t{kTileRows} * 2 * depth + kTail;
}

// Of each half of a tile.
struct Longest2 {
  std::int32_t of_half[2];
};

Longest2 LongestOf(const std::uint8_t* tile, int depth) {
  const std::uint8_t* const norm2 = tile + 2 * depth * kTileQueries;
  return {LongestQuery(norm2, kHalfTile), LongestQuery(norm2 + 4 * kHalfTile, kHalfTile)};
}

std::int32_t LongestRow(const std::uint8_t* block, int depth) {
  return FourBytes(block + 2 * depth * kTileRows);
}

void ProductsPlain(const std::uint8_t* queries, const std::uint8_t* block, int depth,
                   std::int32_t* products, std::size_t stride) {
  const Longest2 longest2 = LongestOf(queries, depth);
  for (int half = 0; half < 2; ++half) {
    const int first = half * kHalfTile;
    if (!FitShort(longest2.of_half[half], LongestRow(block, depth))) {
      SumWide(queries, block, depth, first, products, stride);
      continue;
    }
    const ShortSums sums = SumShort(queries, block, depth, first);
    for (int i = 0; i < kHalfTile; ++i) {
      const Products of_query = ProductsOf(sums, i);
      for (int v = 0; v < kTileRows / 4; ++v) {
        vst1q_s32(products + (first + i) * stride + 4 * v, of_query.of_rows[v]);
      }
    }
  }
}

// Half of each of eight norms, rounded down, cut to 16 bits.
int16x8_t HalfNorms(const std::int32_t* norm2) {
  return vcombine_s16(vqmovn_s32(vshrq_n_s32(vld1q_s32(norm2), 1)),
                      vqmovn_s32(vshrq_n_s32(vld1q_s32(norm2 + 4), 1)));
}

// What is above a limit in 32 bits is so in 16, too: see dot_tile_kernels.h.
bool CompareShort(const ShortSums& sums, const std::int32_t* norm2, const std::int32_t* limits,
                  int first, DotTile::Likeness& likeness) {
  const int16x8_t least = vdupq_n_s16(kLeastDifference);
  const int16x8_t half_low = HalfNorms(norm2), half_high = HalfNorms(norm2 + 8);
  std::uint32_t any = 0;
  for (int i = 0; i < kHalfTile; ++i) {
    const int q = first + i;
    const int16x8_t limit = vdupq_n_s16(HalfLimit(limits[q]));
    const auto may_be = [&](uint16x8_t sum, int16x8_t half) {
      const int16x8_t difference = vqsubq_s16(vreinterpretq_s16_u16(sum), half);
      return vcgtq_s16(vmaxq_s16(difference, least), limit);
    };
    const uint16x8_t either =
        vorrq_u16(may_be(sums.low[i], half_low), may_be(sums.high[i], half_high));
    likeness.above[q] = vmaxvq_u16(either) == 0 ? 0
                                                : WriteLikeness(ProductsOf(sums, i), norm2,
                                                                limits[q], likeness.of_query[q]);
    any |= likeness.above[q];
  }
  return any != 0;
}

int FindAbovePlain(const std::uint8_t* queries, const DotTile::Blocks& blocks, int begin, int depth,
                   const std::int32_t* limits, DotTile::Likeness& likeness) {
  const Longest2 longest2 = LongestOf(queries, depth);
  for (int b = begin; b < blocks.size; ++b) {
    const std::uint8_t* const block = blocks.rows + b * PlainBlockBytes(depth);
    const std::int32_t* const norm2 = blocks.norm2 + b * kTileRows;
    bool any = false;
    for (int half = 0; half < 2; ++half) {
      const int first = half * kHalfTile;
      if (FitShort(longest2.of_half[half], LongestRow(block, depth))) {
        any |= CompareShort(SumShort(queries, block, depth, first), norm2, limits, first, likeness);
      } else {
        SumWide(queries, block, depth, first, likeness.of_query[0], kTileRows);
        any |= CompareWide(norm2, limits, first, first + kHalfTile, likeness);
      }
    }
    if (any) return b;
  }
  return blocks.size;
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

constexpr std::size_t PlainBlockBytes(int depth) { return std::size_t{kTileRows} * 2 * depth; }

constexpr auto FindAbovePlain = FindAboveBy<ProductsPlain, PlainBlockBytes>;

#endif

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
        const std::int32_t four = FourBytes(queries + d * kTileQueries + 4 * (q + i));
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

int FindAboveNeonDot(const std::uint8_t* queries, const DotTile::Blocks& blocks, int begin,
                     int depth, const std::int32_t* limits, DotTile::Likeness& likeness) {
  for (int b = begin; b < blocks.size; ++b) {
    ProductsNeonDot(queries, blocks.rows + b * NeonDotBlockBytes(depth), depth,
                    likeness.of_query[0], kTileRows);
    if (CompareWide(blocks.norm2 + b * kTileRows, limits, 0, kTileQueries, likeness)) return b;
  }
  return blocks.size;
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
    k.find_above = FindAboveNeonDot;
    return k;
  }
#endif
  k.pack_query = k.pack_row = PackAs<std::int16_t, 1, 1>;
  k.value_bytes = 2;
  k.block_tail_bytes = kTail;
  k.products = ProductsPlain;
  k.find_above = FindAbovePlain;
  return k;
}

}  // namespace viewfix

#endif
