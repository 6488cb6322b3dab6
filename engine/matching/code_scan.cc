// SPDX-License-Identifier: BSD-3-Clause
#include "engine/matching/code_scan.h"

#include <algorithm>
#include <cstdlib>
#include <limits>

#if defined(__x86_64__)
#include <immintrin.h>
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif

namespace viewfix {

namespace {

// Whether codes are looked up in tables of bytes.
bool HasByteTables([[maybe_unused]] CpuPath path) {
#if defined(__x86_64__)
  return path == CpuPath::kAvx512Vnni;
#else
  return true;
#endif
}

}  // namespace

CodeScan::CodeScan(int parts, CpuPath path)
    : parts_(parts),
      path_(path),
      bytes_(HasByteTables(path)),
      word_table_(bytes_ ? 0 : std::size_t(parts) * kCodesOfPart),
      byte_table_(bytes_ ? std::size_t(parts) * kCodesOfPart : 0),
      sums_(kMaxBlocks * kScanBlock) {}

#if defined(__x86_64__) || defined(__aarch64__)
namespace {

constexpr int kHalf = kScanBlock / 2;
static_assert(ScanPlace(1) == 2 && ScanPlace(kHalf) == 1);

#if defined(__x86_64__)

#define VIEWFIX_WORDS "avx512f,avx512bw"
#define VIEWFIX_BYTES "avx512f,avx512bw,avx512vbmi"

// The 256 values of one part.
template <int kVectors>
struct Table {
  __m512i values[kVectors];
};
using WordTable = Table<8>;
using ByteTable = Table<4>;

template <int kVectors, typename T>
[[gnu::target(VIEWFIX_WORDS)]] inline Table<kVectors> Load(const T* table) {
  constexpr int kEach = kCodesOfPart / kVectors;
  static_assert(kEach * sizeof(T) == sizeof(__m512i));
  Table<kVectors> loaded;
  for (int i = 0; i < kVectors; ++i) loaded.values[i] = _mm512_loadu_si512(table + i * kEach);
  return loaded;
}

// One instruction looks up 6 bits of a code in two vectors; the upper two bits choose which two.
[[gnu::target(VIEWFIX_WORDS)]] inline __m512i LookUp(const WordTable& table, __m512i codes) {
  const __m512i* const v = table.values;
  const __mmask32 bit6 = _mm512_test_epi16_mask(codes, _mm512_set1_epi16(64));
  const __mmask32 bit7 = _mm512_test_epi16_mask(codes, _mm512_set1_epi16(128));
  const __m512i low = _mm512_mask_blend_epi16(bit6, _mm512_permutex2var_epi16(v[0], codes, v[1]),
                                              _mm512_permutex2var_epi16(v[2], codes, v[3]));
  const __m512i high = _mm512_mask_blend_epi16(bit6, _mm512_permutex2var_epi16(v[4], codes, v[5]),
                                               _mm512_permutex2var_epi16(v[6], codes, v[7]));
  return _mm512_mask_blend_epi16(bit7, low, high);
}

// The same of bytes: 7 bits of a code in two vectors.
[[gnu::target(VIEWFIX_BYTES)]] inline __m512i LookUp(const ByteTable& table, __m512i codes) {
  const __m512i* const v = table.values;
  return _mm512_mask_blend_epi8(_mm512_movepi8_mask(codes),
                                _mm512_permutex2var_epi8(v[0], codes, v[1]),
                                _mm512_permutex2var_epi8(v[2], codes, v[3]));
}

// The two halves of a block: what lies in the lower and in the upper bytes.
struct Halves {
  __m512i first, second;
};

[[gnu::target(VIEWFIX_WORDS)]] inline Halves Widen(__m512i bytes) {
  return {_mm512_and_si512(bytes, _mm512_set1_epi16(255)), _mm512_srli_epi16(bytes, 8)};
}

[[gnu::target(VIEWFIX_WORDS)]] inline void AddTo(std::int16_t* sums, bool begin, Halves halves) {
  if (!begin) {
    halves.first = _mm512_add_epi16(halves.first, _mm512_loadu_si512(sums));
    halves.second = _mm512_add_epi16(halves.second, _mm512_loadu_si512(sums + kHalf));
  }
  _mm512_storeu_si512(sums, halves.first);
  _mm512_storeu_si512(sums + kHalf, halves.second);
}

// Part after part, so that a part's table stays in registers.
[[gnu::target(VIEWFIX_WORDS)]] void SumWords(const std::int16_t* table, const std::uint8_t* codes,
                                             int parts, int num_blocks, std::int16_t* sums) {
  for (int p = 0; p < parts; ++p) {
    const WordTable part = Load<8>(table + p * kCodesOfPart);
    for (int b = 0; b < num_blocks; ++b) {
      const Halves of_part =
          Widen(_mm512_loadu_si512(codes + (std::size_t(b) * parts + p) * kScanBlock));
      AddTo(sums + b * kScanBlock, p == 0,
            {LookUp(part, of_part.first), LookUp(part, of_part.second)});
    }
  }
}

[[gnu::target(VIEWFIX_BYTES)]] void SumBytes(const std::uint8_t* table, const std::uint8_t* codes,
                                             int parts, int num_blocks, std::int16_t* sums) {
  for (int p = 0; p < parts; ++p) {
    const ByteTable part = Load<4>(table + p * kCodesOfPart);
    for (int b = 0; b < num_blocks; ++b) {
      const __m512i of_part = _mm512_loadu_si512(codes + (std::size_t(b) * parts + p) * kScanBlock);
      AddTo(sums + b * kScanBlock, p == 0, Widen(LookUp(part, of_part)));
    }
  }
}

// found: sum - norm2 / 2 / 2^shift >= least, the division rounded down, the difference cut
[[gnu::target(VIEWFIX_WORDS)]] void FindGreat(const std::int16_t* sums, const std::uint16_t* norm2,
                                              int num_blocks, std::int16_t least, int shift,
                                              std::uint64_t* found) {
  const __m512i limit = _mm512_set1_epi16(least);
  const auto great = [&](int i) __attribute__((target(VIEWFIX_WORDS))) {
    const __m512i half = _mm512_srli_epi16(_mm512_loadu_si512(norm2 + i), 1 + shift);
    const __m512i difference = _mm512_subs_epi16(_mm512_loadu_si512(sums + i), half);
    return std::uint64_t{_mm512_cmpge_epi16_mask(difference, limit)};
  };
  for (int b = 0; b < num_blocks; ++b) {
    found[b] = great(b * kScanBlock) | great(b * kScanBlock + kHalf) << kHalf;
  }
}

#else

// One instruction looks up 6 bits of a code in four vectors; where the code is greater than what
// they hold, it leaves what there was.
struct ByteTable {
  uint8x16x4_t quarters[4];
};

ByteTable Load(const std::uint8_t* table) {
  ByteTable loaded;
  for (int i = 0; i < 4; ++i) loaded.quarters[i] = vld1q_u8_x4(table + 64 * i);
  return loaded;
}

uint8x16_t LookUp(const ByteTable& table, uint8x16_t codes) {
  const uint8x16_t quarter = vdupq_n_u8(64);
  uint8x16_t values = vqtbl4q_u8(table.quarters[0], codes);
  for (int i = 1; i < 4; ++i) {
    codes = vsubq_u8(codes, quarter);
    values = vqtbx4q_u8(values, table.quarters[i], codes);
  }
  return values;
}

// Part after part, so that a part's table stays in registers.
void SumBytes(const std::uint8_t* table, const std::uint8_t* codes, int parts, int num_blocks,
              std::int16_t* sums) {
  auto* const counts = reinterpret_cast<std::uint16_t*>(sums);
  std::fill_n(counts, num_blocks * kScanBlock, std::uint16_t{0});
  for (int p = 0; p < parts; ++p) {
    const ByteTable part = Load(table + p * kCodesOfPart);
    for (int b = 0; b < num_blocks; ++b) {
      const std::uint8_t* const of_part = codes + (std::size_t(b) * parts + p) * kScanBlock;
      std::uint16_t* const first = counts + b * kScanBlock;
      for (int i = 0; i < kHalf; i += 8) {
        const uint16x8_t values = vreinterpretq_u16_u8(LookUp(part, vld1q_u8(of_part + 2 * i)));
        vst1q_u16(first + i, vaddq_u16(vld1q_u16(first + i), vandq_u16(values, vdupq_n_u16(255))));
        vst1q_u16(first + kHalf + i, vsraq_n_u16(vld1q_u16(first + kHalf + i), values, 8));
      }
    }
  }
}

// found: sum - norm2 / 2 / 2^shift >= least, the division rounded down, the difference cut
void FindGreat(const std::int16_t* sums, const std::uint16_t* norm2, int num_blocks,
               std::int16_t least, int shift, std::uint64_t* found) {
  constexpr std::uint16_t kBits[] = {1, 2, 4, 8, 16, 32, 64, 128};
  const uint16x8_t bits = vld1q_u16(kBits);
  const int16x8_t limit = vdupq_n_s16(least);
  const int16x8_t right = vdupq_n_s16(static_cast<std::int16_t>(-1 - shift));
  for (int b = 0; b < num_blocks; ++b) {
    found[b] = 0;
    for (int i = 0; i < kScanBlock; i += 8) {
      const int at = b * kScanBlock + i;
      const int16x8_t half = vreinterpretq_s16_u16(vshlq_u16(vld1q_u16(norm2 + at), right));
      const uint16x8_t great = vcgeq_s16(vqsubq_s16(vld1q_s16(sums + at), half), limit);
      found[b] |= std::uint64_t{vaddvq_u16(vandq_u16(great, bits))} << i;
    }
  }
}

#endif

struct LargestKernel {
  VIEWFIX_KERNEL void Run(const std::int32_t* values, int n, std::int32_t* largest) {
    std::int32_t magnitude = 0;
    for (int i = 0; i < n; ++i) magnitude = std::max(magnitude, std::abs(values[i]));
    *largest = magnitude;
  }
};

// bytes = (values + offset) / 2^shift, rounded down
struct ToBytesKernel {
  VIEWFIX_KERNEL void Run(const std::int32_t* values, int n, std::int32_t offset, int shift,
                          std::uint8_t* bytes) {
    for (int i = 0; i < n; ++i) bytes[i] = static_cast<std::uint8_t>((values[i] + offset) >> shift);
  }
};

struct ToWordsKernel {
  VIEWFIX_KERNEL void Run(const std::int32_t* values, int n, std::int16_t* words) {
    for (int i = 0; i < n; ++i) words[i] = static_cast<std::int16_t>(values[i]);
  }
};

}  // namespace

// Bytes are rounded up, so that a sum of them is never less than that of what they stand for.
void CodeScan::SetTable(const std::int32_t* table) {
  const int size = parts_ * kCodesOfPart;
  if (!bytes_) return RunOnPath<ToWordsKernel>(path_, table, size, word_table_.data());
  RunOnPath<LargestKernel>(path_, table, size, &largest_);
  shift_ = 0;
  while (2 * largest_ > 255 << shift_) ++shift_;
  RunOnPath<ToBytesKernel>(path_, table, size, largest_ + (1 << shift_) - 1, shift_,
                           byte_table_.data());
}

void CodeScan::Scan(const std::uint8_t* codes, const std::uint16_t* norm2, int num_blocks,
                    std::int32_t least, std::uint64_t* found) {
  using Limits = std::numeric_limits<std::int16_t>;
  // s' / 2^shift >= (norm2 / 2 + needed) / 2^shift, which is not less than the sum of both rounded
  // down.
  const std::int32_t needed = (least + parts_ * largest_) >> shift_;
  const auto limit =
      static_cast<std::int16_t>(std::clamp<std::int32_t>(needed, Limits::min(), Limits::max()));
#if defined(__x86_64__)
  if (!bytes_) SumWords(word_table_.data(), codes, parts_, num_blocks, sums_.data());
#endif
  if (bytes_) SumBytes(byte_table_.data(), codes, parts_, num_blocks, sums_.data());
  FindGreat(sums_.data(), norm2, num_blocks, limit, shift_, found);
}

#else

void CodeScan::SetTable(const std::int32_t*) {}
void CodeScan::Scan(const std::uint8_t*, const std::uint16_t*, int, std::int32_t, std::uint64_t*) {}

#endif

}  // namespace viewfix
