// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>

#include "engine/base/cpu_path.h"
#include "engine/matching/dot_tile.h"

namespace viewfix {

static_assert(kTileQueries == kTileRows);  // a tile and a block lie alike
inline constexpr int kHalfTile = kTileQueries / 2;
// Values that lie together where they are multiplied and added as four bytes by four bytes.
inline constexpr int kBytesTogether = 4;

inline std::int32_t FourBytes(const std::uint8_t* values) {
  std::int32_t four;
  std::memcpy(&four, values, sizeof(four));
  return four;
}

// Sums of 16 bits. By Cauchy and Schwarz neither the product of two descriptors nor that of any of
// their values alone is beyond |q| |r|: where that fits into 16 bits, so does all that is summed on
// the way. SURF's descriptors are of length 127; of much longer ones sums of 32 bits are made.
inline constexpr std::int64_t kMaxShort = std::numeric_limits<std::int16_t>::max();

inline bool FitShort(std::int32_t query_norm2, std::int32_t row_norm2) {
  return std::int64_t{query_norm2} * row_norm2 <= kMaxShort * kMaxShort;
}

// What is above a limit in 32 bits, 2 q'r - |r|^2 > limit, is so in 16 bits, too: q'r - |r|^2 / 2,
// the half rounded down and the difference cut to at least this, > HalfLimit(limit). A little of
// what is not is as well.
inline constexpr std::int16_t kLeastDifference = std::numeric_limits<std::int16_t>::min() + 1;

inline std::int16_t HalfLimit(std::int32_t limit) {
  using Short = std::numeric_limits<std::int16_t>;
  return static_cast<std::int16_t>(
      std::clamp<std::int32_t>(limit >> 1, Short::min(), Short::max()));
}

// Of n queries, whose squared lengths begin at `norm2`.
inline std::int32_t LongestQuery(const std::uint8_t* norm2, int n) {
  std::int32_t longest = 0;
  for (int i = 0; i < n; ++i) longest = std::max(longest, FourBytes(norm2 + 4 * i));
  return longest;
}

// Packs a descriptor as number `i` of a tile or a block of `depth` values each, `offset` added to
// each value; kTogether of its values lie side by side, kCopies times.
template <typename Value, int kTogether, int kCopies>
void PackAs(std::span<const std::int8_t> descriptor, int i, int offset, int depth,
            std::uint8_t* packed) {
  const int dim = static_cast<int>(descriptor.size());
  for (int d = 0; d < depth; d += kTogether) {
    Value values[kCopies][kTogether];
    for (int j = 0; j < kTogether; ++j) {
      const int value = (d + j < dim ? descriptor[d + j] : 0) + offset;
      for (int copy = 0; copy < kCopies; ++copy) values[copy][j] = static_cast<Value>(value);
    }
    std::memcpy(packed + sizeof(Value) * kCopies * (d * kTileRows + i * kTogether), values,
                sizeof(values));
  }
}

// Products become likeness, where there are no compare masks; of queries begin .. end - 1. Sets
// `any` if one is above its limit. Most rows are not, which whole vectors see at once.
struct CompareKernel {
  VIEWFIX_KERNEL void Run(const std::int32_t* norm2, const std::int32_t* limits, int begin, int end,
                          DotTile::Likeness* likeness, bool* any) {
    for (int i = begin; i < end; ++i) {
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

// DotTile::FindAbove() by kProducts.
//   kBlockBytes   of a block of a depth
template <auto kProducts, auto kBlockBytes>
int FindAboveBy(const std::uint8_t* queries, const DotTile::Blocks& blocks, int begin, int depth,
                const std::int32_t* limits, DotTile::Likeness& likeness) {
  for (int b = begin; b < blocks.size; ++b) {
    kProducts(queries, blocks.rows + b * kBlockBytes(depth), depth, likeness.of_query[0],
              kTileRows);
    bool any = false;
    CompareKernel::Run(blocks.norm2 + b * kTileRows, limits, 0, kTileQueries, &likeness, &any);
    if (any) return b;
  }
  return blocks.size;
}

}  // namespace viewfix
