// SPDX-License-Identifier: BSD-3-Clause
#include "engine/matching/code_scan.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace viewfix {

#if defined(__x86_64__)
namespace {

// The 256 values of one part.
struct PartTable {
  __m512i values[8];
};

[[gnu::target("avx512f,avx512bw")]] inline PartTable LoadTable(const std::int16_t* table) {
  PartTable loaded;
  for (int i = 0; i < 8; ++i) loaded.values[i] = _mm512_loadu_si512(table + i * kScanBlock);
  return loaded;
}

// One instruction looks up 6 bits of a code in two vectors; the upper two bits choose which two.
[[gnu::target("avx512f,avx512bw")]] inline __m512i LookUp(const PartTable& table, __m512i codes) {
  const __m512i* const v = table.values;
  const __mmask32 bit6 = _mm512_test_epi16_mask(codes, _mm512_set1_epi16(64));
  const __mmask32 bit7 = _mm512_test_epi16_mask(codes, _mm512_set1_epi16(128));
  const __m512i low = _mm512_mask_blend_epi16(bit6, _mm512_permutex2var_epi16(v[0], codes, v[1]),
                                              _mm512_permutex2var_epi16(v[2], codes, v[3]));
  const __m512i high = _mm512_mask_blend_epi16(bit6, _mm512_permutex2var_epi16(v[4], codes, v[5]),
                                               _mm512_permutex2var_epi16(v[6], codes, v[7]));
  return _mm512_mask_blend_epi16(bit7, low, high);
}

// Part after part, so that a part's table stays in registers.
[[gnu::target("avx512f,avx512bw")]] void ScanAvx512(const std::int16_t* table,
                                                    const std::uint8_t* codes,
                                                    const std::int16_t* half_norm2, int parts,
                                                    int num_blocks, std::int16_t least,
                                                    std::int16_t* sums, std::uint32_t* found) {
  for (int p = 0; p < parts; ++p) {
    const PartTable part = LoadTable(table + p * kCodesOfPart);
    for (int b = 0; b < num_blocks; ++b) {
      const auto* const bytes =
          reinterpret_cast<const __m256i*>(codes + (b * parts + p) * kScanBlock);
      const __m512i values = LookUp(part, _mm512_cvtepu8_epi16(_mm256_loadu_si256(bytes)));
      std::int16_t* const sum = sums + b * kScanBlock;
      const __m512i before = p == 0 ? _mm512_setzero_si512() : _mm512_loadu_si512(sum);
      _mm512_storeu_si512(sum, _mm512_add_epi16(before, values));
    }
  }
  const __m512i limit = _mm512_set1_epi16(least);
  for (int b = 0; b < num_blocks; ++b) {
    const __m512i sum = _mm512_loadu_si512(sums + b * kScanBlock);
    const __m512i norm2 = _mm512_loadu_si512(half_norm2 + b * kScanBlock);
    found[b] = _mm512_cmpge_epi16_mask(_mm512_subs_epi16(sum, norm2), limit);
  }
}

}  // namespace

ScanCodes ScanCodesFor(CpuPath path) { return path == CpuPath::kAvx512 ? ScanAvx512 : nullptr; }
#else
ScanCodes ScanCodesFor(CpuPath) { return nullptr; }
#endif

}  // namespace viewfix
