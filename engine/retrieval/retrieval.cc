// SPDX-License-Identifier: BSD-3-Clause
#include "engine/retrieval/retrieval.h"

namespace viewfix {

// The maps are powers, so that MapCount(count, total) = MapCount(count, 1) * MapCount(1, total).
Retrieval::Retrieval(const ModelKeyframes& keyframes, HistogramMap map, int num_words,
                     int num_pairs)
    : keyframes_(keyframes),
      query_(num_words, 0.0F),
      first_of_pair_(num_pairs + 1, 0),
      scale_(keyframes.size, 0.0F),
      norm2_(keyframes.size, 0.0F) {
  query_words_.reserve(num_words);
  for (const std::uint16_t pair : keyframes.pair) ++first_of_pair_[pair + 1];
  for (int p = 0; p < num_pairs; ++p) first_of_pair_[p + 1] += first_of_pair_[p];
  for (int count = 0; count <= kMaxKeyframeCount; ++count) {
    mapped_count_[count] = MapCount(map, count, 1);
  }
  for (int k = 0; k < keyframes.size; ++k) {
    const std::uint32_t begin = keyframes.word_begin[k];
    const std::uint32_t end = keyframes.word_begin[k + 1];
    int total = 0;
    for (std::uint32_t j = begin; j < end; ++j) total += CountOf(keyframes.words[j]);
    scale_[k] = MapCount(map, 1, total);
    for (std::uint32_t j = begin; j < end; ++j) {
      const float value = scale_[k] * mapped_count_[CountOf(keyframes.words[j])];
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
  int word = -1;
  for (std::uint32_t j = keyframes_.word_begin[keyframe_idx];
       j < keyframes_.word_begin[keyframe_idx + 1]; ++j) {
    word += StepOf(keyframes_.words[j]);
    dot += query_[word] * mapped_count_[CountOf(keyframes_.words[j])];
  }
  return scale_[keyframe_idx] * dot - 0.5F * norm2_[keyframe_idx];
}

void Retrieval::Similarities(std::span<float> similarities) const {
  for (int k = 0; k < keyframes_.size; ++k) similarities[k] = Similarity(k);
}

}  // namespace viewfix
