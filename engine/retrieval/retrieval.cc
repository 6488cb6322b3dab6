// SPDX-License-Identifier: BSD-3-Clause
#include "engine/retrieval/retrieval.h"

#include <algorithm>
#include <cmath>

namespace viewfix {

Retrieval::Retrieval(const ModelKeyframes& keyframes, HistogramMap map, int num_words,
                     int num_pairs)
    : keyframes_(keyframes),
      map_(map),
      query_(num_words, 0.0F),
      first_of_pair_(num_pairs + 1, 0),
      total_(keyframes.size, 0),
      norm2_(keyframes.size, 0.0F) {
  query_words_.reserve(num_words);
  for (const std::uint16_t pair : keyframes.pair) ++first_of_pair_[pair + 1];
  for (int p = 0; p < num_pairs; ++p) first_of_pair_[p + 1] += first_of_pair_[p];
  for (int k = 0; k < keyframes.size; ++k) {
    const std::uint32_t begin = keyframes.word_begin[k];
    const std::uint32_t end = keyframes.word_begin[k + 1];
    for (std::uint32_t j = begin; j < end; ++j) total_[k] += keyframes.counts[j];
    for (std::uint32_t j = begin; j < end; ++j) {
      const float value = MapCount(map, keyframes.counts[j], total_[k]);
      norm2_[k] += value * value;
    }
  }
}

void Retrieval::SetQuery(const Histogram& query) {
  for (const std::uint16_t word : query_words_) query_[word] = 0.0F;
  query_words_.assign(query.words.begin(), query.words.end());
  for (int i = 0; i < query.size(); ++i) query_[query.words[i]] = query.values[i];
}

float Retrieval::Similarity(int keyframe_idx) const {
  float dot = 0.0F;
  for (std::uint32_t j = keyframes_.word_begin[keyframe_idx];
       j < keyframes_.word_begin[keyframe_idx + 1]; ++j) {
    const float q = query_[keyframes_.words[j]];
    if (q > 0.0F) dot += q * MapCount(map_, keyframes_.counts[j], total_[keyframe_idx]);
  }
  return dot - 0.5F * norm2_[keyframe_idx];
}

int Retrieval::Nearest(int first, int last) const {
  int best = -1;
  float best_similarity = 0.0F;
  for (int k = first; k < last; ++k) {
    const float similarity = Similarity(k);
    if (best < 0 || similarity > best_similarity) {
      best = k;
      best_similarity = similarity;
    }
  }
  return best;
}

}  // namespace viewfix
