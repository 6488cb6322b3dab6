// SPDX-License-Identifier: BSD-3-Clause
#include "engine/scoring/scoring.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace viewfix {
namespace {

constexpr int kColumnBlock = 4096;  // bytes of a row: their sums stay in the nearest caches
constexpr int kWordsTogether = 4;   // for one reading and writing of a sum

float LowWeight(std::uint8_t both) { return static_cast<float>((both & 15) - kWeightBias); }
float HighWeight(std::uint8_t both) { return static_cast<float>((both >> 4) - kWeightBias); }

// Adds kWordsTogether words' weights to the sums of a block of columns, word after word. A column
// is a byte of the words' rows: `low` are the sums of even pairs, `high` those of the odd ones.
struct AddWordsKernel {
  VIEWFIX_KERNEL void Run(const std::uint8_t* const* rows, const float* values, int columns,
                          float* low_out, float* high_out) {
    float* __restrict low = low_out;
    float* __restrict high = high_out;
    const std::uint8_t *row0 = rows[0], *row1 = rows[1], *row2 = rows[2], *row3 = rows[3];
    const float value0 = values[0], value1 = values[1], value2 = values[2], value3 = values[3];
    for (int c = 0; c < columns; ++c) {
      float even = low[c], odd = high[c];
      even += value0 * LowWeight(row0[c]);
      odd += value0 * HighWeight(row0[c]);
      even += value1 * LowWeight(row1[c]);
      odd += value1 * HighWeight(row1[c]);
      even += value2 * LowWeight(row2[c]);
      odd += value2 * HighWeight(row2[c]);
      even += value3 * LowWeight(row3[c]);
      odd += value3 * HighWeight(row3[c]);
      low[c] = even;
      high[c] = odd;
    }
  }
};

struct AddWordKernel {
  VIEWFIX_KERNEL void Run(const std::uint8_t* row, float value, int columns, float* low_out,
                          float* high_out) {
    float* __restrict low = low_out;
    float* __restrict high = high_out;
    for (int c = 0; c < columns; ++c) {
      low[c] += value * LowWeight(row[c]);
      high[c] += value * HighWeight(row[c]);
    }
  }
};

#if defined(__x86_64__)

// As AddWordsKernel, for whole vectors of columns. A word adds one of 16 products to a sum: they
// are made once, and looked up by one instruction. (Masks of ones: what GCC 12 makes of the
// instructions without masks it takes for uninitialized.)
[[gnu::target("avx512f")]] void AddWordsAvx512(const std::uint8_t* const* rows, const float* values,
                                               int columns, float* low, float* high) {
  constexpr int kLanes = 16;
  const __m512 weights = _mm512_set_ps(7, 6, 5, 4, 3, 2, 1, 0, -1, -2, -3, -4, -5, -6, -7, -8);
  __m512 products[kWordsTogether];
  for (int i = 0; i < kWordsTogether; ++i) {
    products[i] = _mm512_mul_ps(_mm512_set1_ps(values[i]), weights);
  }
  for (int c = 0; c < columns; c += kLanes) {
    __m512 even = _mm512_loadu_ps(low + c), odd = _mm512_loadu_ps(high + c);
    for (int i = 0; i < kWordsTogether; ++i) {
      const auto* const bytes = reinterpret_cast<const __m128i*>(rows[i] + c);
      const __m512i both = _mm512_maskz_cvtepu8_epi32(0xffff, _mm_loadu_si128(bytes));
      const __m512i upper = _mm512_maskz_srli_epi32(0xffff, both, 4);
      even = _mm512_add_ps(even, _mm512_maskz_permutexvar_ps(0xffff, both, products[i]));
      odd = _mm512_add_ps(odd, _mm512_maskz_permutexvar_ps(0xffff, upper, products[i]));
    }
    _mm512_storeu_ps(low + c, even);
    _mm512_storeu_ps(high + c, odd);
  }
}

#endif

void AddWords(const std::uint8_t* const* rows, const float* values, int columns, CpuPath path,
              float* low, float* high) {
  int done = 0;
#if defined(__x86_64__)
  if (path >= CpuPath::kAvx512) {
    done = columns / 16 * 16;
    AddWordsAvx512(rows, values, done, low, high);
  }
#endif
  const std::uint8_t* const rest[kWordsTogether] = {rows[0] + done, rows[1] + done, rows[2] + done,
                                                    rows[3] + done};
  RunOnPath<AddWordsKernel>(path, &rest[0], values, columns - done, low + done, high + done);
}

// The sums of the pairs of `columns` bytes of each row.
void SumBlock(const ModelScoring& model, const Histogram& histogram, int first_column, int columns,
              CpuPath path, float* low, float* high) {
  std::fill_n(low, columns, 0.0F);
  std::fill_n(high, columns, 0.0F);
  const std::size_t row_bytes = PackedWeights(model.num_pairs);
  const auto row = [&](int i) {
    return &model.weights[histogram.words[i] * row_bytes + first_column];
  };
  int i = 0;
  for (; i + kWordsTogether <= histogram.size(); i += kWordsTogether) {
    const std::uint8_t* const rows[kWordsTogether] = {row(i), row(i + 1), row(i + 2), row(i + 3)};
    AddWords(&rows[0], &histogram.values[i], columns, path, low, high);
  }
  for (; i < histogram.size(); ++i) {
    RunOnPath<AddWordKernel>(path, row(i), histogram.values[i], columns, low, high);
  }
}

}  // namespace

void ScorePairs(const ModelScoring& model, const Histogram& histogram, std::span<float> scores,
                CpuPath path) {
  std::array<float, kColumnBlock> low, high;
  const int row_bytes = PackedWeights(model.num_pairs);
  for (int first = 0; first < row_bytes; first += kColumnBlock) {
    const int columns = std::min(kColumnBlock, row_bytes - first);
    SumBlock(model, histogram, first, columns, path, low.data(), high.data());
    const int end = std::min(model.num_pairs, 2 * (first + columns));
    for (int p = 2 * first; p < end; ++p) {
      const float sum = (p % 2 == 0 ? low : high)[p / 2 - first];
      scores[p] = model.bias[p] + model.weight_scale[p] * sum;
    }
  }
}

void AddKeyframeSimilarity(const ModelScoring& model, const ModelKeyframes& keyframes,
                           std::span<const float> similarities, std::span<float> pair_scores) {
  int k = 0;
  for (int p = 0; p < model.num_pairs; ++p) {
    float best = kNoSimilarity;
    for (; k < keyframes.size && keyframes.pair[k] == p; ++k) {
      best = std::max(best, similarities[k]);
    }
    pair_scores[p] += model.keyframe_weight * best;
  }
}

void LikenessOfLocations(const ModelScoring& model, const ModelKeyframes& keyframes,
                         std::span<const float> similarities, std::span<float> likeness) {
  std::fill(likeness.begin(), likeness.end(), kNoSimilarity);
  for (int k = 0; k < keyframes.size; ++k) {
    float& best = likeness[model.pair_location[keyframes.pair[k]]];
    best = std::max(best, similarities[k]);
  }
}

void ScoreLocations(const ModelScoring& model, std::span<const float> pair_scores,
                    std::span<float> location_scores) {
  const bool sum = model.location_rule == LocationRule::kSumOfPairs;
  const float start = sum ? 0.0F : std::numeric_limits<float>::lowest();
  std::fill(location_scores.begin(), location_scores.end(), start);
  for (int p = 0; p < model.num_pairs; ++p) {
    float& score = location_scores[model.pair_location[p]];
    score = sum ? score + pair_scores[p] : std::max(score, pair_scores[p]);
  }
}

int BestPairOf(const ModelScoring& model, std::span<const float> pair_scores, int location_idx) {
  int best = -1;
  for (int p = 0; p < model.num_pairs; ++p) {
    if (model.pair_location[p] != location_idx) continue;
    if (best < 0 || pair_scores[p] > pair_scores[best]) best = p;
  }
  return best;
}

}  // namespace viewfix
