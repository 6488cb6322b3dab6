// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/vocabulary/vocabulary.h"
#include "models/model_view.h"

namespace viewfix {

// Keyframes near a histogram. Allocates in the constructor only. One instance serves one
// thread; the model's bytes must outlive it.
class Retrieval {
 public:
  Retrieval(const ModelKeyframes& keyframes, HistogramMap map, int num_words, int num_pairs);

  // Sets the histogram that the calls below compare with.
  void SetQuery(const Histogram& query);
  // Keyframes of a pair: [first, last).
  int FirstOf(int pair_idx) const { return first_of_pair_[pair_idx]; }
  int LastOf(int pair_idx) const { return first_of_pair_[pair_idx + 1]; }
  // q'h - |h|^2 / 2 of all keyframes: orders them as their Euclidean distance to the query does.
  //   similarities [keyframes]
  void Similarities(std::span<float> similarities) const;

 private:
  struct Walk;

  // What an entry of a keyframe's histogram stands for: looked up, not worked out anew.
  struct Entry {
    std::int32_t step;
    float mapped_count;  // before scale_; of 0: 0
  };

  ModelKeyframes keyframes_;
  std::array<Entry, 256> entries_;
  std::vector<float> query_;  // [1 + words] dense, behind one that stands before the first
  std::vector<std::uint16_t> query_words_;
  std::vector<int> first_of_pair_;  // [pairs + 1]
  std::vector<float> scale_;        // [keyframes] h = scale * mapped count
  std::vector<float> norm2_;        // [keyframes] |h|^2
};

}  // namespace viewfix
