// SPDX-License-Identifier: BSD-3-Clause
#include "engine/retrieval/retrieval.h"

#include <cstddef>

namespace viewfix {

// The maps are powers, so that MapCount(count, total) = MapCount(count, 1) * MapCount(1, total).
Retrieval::Retrieval(const ModelKeyframes& keyframes, HistogramMap map, int num_words,
                     int num_pairs)
    : keyframes_(keyframes),
      query_(1 + num_words, 0.0F),
      first_of_pair_(num_pairs + 1, 0),
      scale_(keyframes.size, 0.0F),
      norm2_(keyframes.size, 0.0F) {
  query_words_.reserve(num_words);
  for (const std::uint16_t pair : keyframes.pair) ++first_of_pair_[pair + 1];
  for (int p = 0; p < num_pairs; ++p) first_of_pair_[p + 1] += first_of_pair_[p];
  for (std::size_t e = 0; e < entries_.size(); ++e) {
    const auto entry = static_cast<std::uint8_t>(e);
    entries_[e] = {StepOf(entry), MapCount(map, CountOf(entry), 1)};
  }
  for (int k = 0; k < keyframes.size; ++k) {
    const std::uint32_t begin = keyframes.word_begin[k];
    const std::uint32_t end = keyframes.word_begin[k + 1];
    int total = 0;
    for (std::uint32_t j = begin; j < end; ++j) total += CountOf(keyframes.words[j]);
    scale_[k] = MapCount(map, 1, total);
    for (std::uint32_t j = begin; j < end; ++j) {
      const float value = scale_[k] * entries_[keyframes.words[j]].mapped_count;
      norm2_[k] += value * value;
    }
  }
}

void Retrieval::SetQuery(const Histogram& query) {
  for (const std::uint16_t word : query_words_) query_[1 + word] = 0.0F;
  query_words_.assign(query.words.begin(), query.words.end());
  for (int i = 0; i < query.size(); ++i) query_[1 + query.words[i]] = query.values[i];
}

// One keyframe's words, in their order.
struct Retrieval::Walk {
  const std::uint8_t* entry;
  const std::uint8_t* end;
  const float* word;  // of the query's, before `entry`
  float dot = 0.0F;

  void Step(const std::array<Entry, 256>& entries) {
    const Entry& next = entries[*entry++];
    word += next.step;
    dot += *word * next.mapped_count;
  }
};

// Two keyframes go together as far as both have words: a sum waits for its last addition, but not
// for the other's.
void Retrieval::Similarities(std::span<float> similarities) const {
  const auto walk_of = [&](int k) {
    const std::uint8_t* const words = keyframes_.words.data();
    return Walk{words + keyframes_.word_begin[k], words + keyframes_.word_begin[k + 1],
                query_.data()};
  };
  const auto finish = [&](int k, Walk& walk) {
    while (walk.entry != walk.end) walk.Step(entries_);
    similarities[k] = scale_[k] * walk.dot - 0.5F * norm2_[k];
  };
  int k = 0;
  for (; k + 1 < keyframes_.size; k += 2) {
    Walk first = walk_of(k), second = walk_of(k + 1);
    while (first.entry != first.end && second.entry != second.end) {
      first.Step(entries_);
      second.Step(entries_);
    }
    finish(k, first);
    finish(k + 1, second);
  }
  if (k < keyframes_.size) {
    Walk last = walk_of(k);
    finish(k, last);
  }
}

}  // namespace viewfix
