// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/cpu_path.h"
#include "engine/features/feature_extractor.h"
#include "engine/matching/dot_tile.h"
#include "models/model_view.h"

namespace viewfix {

// Visual words: finds the cluster centre nearest to a descriptor. Allocates in the
// constructor only. Thread-safe.
class Vocabulary {
 public:
  //   words [num_words, dim] signed bytes, word after word, as descriptors are; copied
  Vocabulary(std::span<const std::int8_t> words, int dim, CpuPath path = BestCpuPath());

  int size() const { return size_; }
  int dim() const { return dim_; }

  // The words of least |d - c_w|^2, that is of largest d'c_w - |c_w|^2 / 2, nearest first;
  // exact in integers, the lower index first among equals.
  //   descriptors [n, dim]   words_out [n, words_per_descriptor]
  //   words_per_descriptor   1..kMaxWordsPerFeature, at most size()
  void NearestWords(std::span<const std::int8_t> descriptors, int words_per_descriptor,
                    std::span<std::uint16_t> words_out) const;

 private:
  int dim_;
  int size_;
  DotTile tile_;
  std::vector<std::uint16_t> word_at_;  // [blocks * kTileRows] the words in order of |c|
  std::vector<std::uint8_t> words_;     // the tile's blocks, one after another, in that order
  std::vector<std::int32_t> norm2_;     // [blocks * kTileRows] |c|^2, likewise
};

// h(x) of eq. (5): how often each visual word occurs in an image, as a sparse vector.
struct Histogram {
  std::vector<std::uint16_t> words;  // ascending
  std::vector<std::uint8_t> counts;  // same order, 1..255
  std::vector<float> values;         // same order: the mapped counts

  int size() const { return static_cast<int>(words.size()); }
};

// h of one count: count / total (L1), or its square root (Hellinger map).
float MapCount(HistogramMap map, int count, int total);

// Counts words into histograms. A feature votes for its nearest words, nearest first, each
// with half the votes of the one before (1; 2, 1; 4, 2, 1; ...): a frame's features often lie
// near the border of two words. Reuses its memory: no allocation after construction when the
// histogram has capacity.
class HistogramBuilder {
 public:
  HistogramBuilder(int num_words, int max_features, int words_per_feature, HistogramMap map);
  // A histogram with room for any image.
  Histogram MakeHistogram() const;
  //   words [n, words_per_feature], n <= max_features
  void Build(std::span<const std::uint16_t> words, Histogram& histogram);

 private:
  HistogramMap map_;
  int words_per_feature_;
  int max_entries_;
  std::vector<std::int32_t> counts_;  // [num_words], zero between calls
};

}  // namespace viewfix
