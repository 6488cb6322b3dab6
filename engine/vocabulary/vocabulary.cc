// SPDX-License-Identifier: BSD-3-Clause
#include "engine/vocabulary/vocabulary.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>

#include "engine/matching/dot_block.h"

namespace viewfix {
namespace {

constexpr int kWordBlock = kDotRows;
constexpr int kDescriptorBlock = 8;  // these stay in the first cache

// The most similar words of one descriptor so far, best first.
struct Ranking {
  std::array<std::int32_t, kMaxWordsPerFeature> similarity;
  std::array<std::uint16_t, kMaxWordsPerFeature> word;

  // A word that is more similar than the last of `ranks`.
  void Insert(int ranks, std::int32_t new_similarity, int new_word) {
    int r = ranks - 1;
    for (; r > 0 && new_similarity > similarity[r - 1]; --r) {
      similarity[r] = similarity[r - 1];
      word[r] = word[r - 1];
    }
    similarity[r] = new_similarity;
    word[r] = static_cast<std::uint16_t>(new_word);
  }
};

// words [size, dim] and norm2 [size], size a multiple of kWordBlock; descriptors [n, dim],
// n <= kDescriptorBlock; rankings [n]
template <int kDim>
void FindNearest(const std::int16_t* descriptors, int n, const std::int16_t* words,
                 const std::int32_t* norm2, int size, int dim, int ranks, Ranking* rankings) {
  for (int i = 0; i < n; ++i) {
    rankings[i].similarity.fill(std::numeric_limits<std::int32_t>::min());
  }
  for (int block = 0; block < size; block += kWordBlock) {
    const std::int16_t* block_words = words + std::size_t(block) * dim;
    for (int i = 0; i < n; ++i) {
      const auto sums = DotBlock<kDim>(descriptors + i * dim, block_words, dim);
      for (int w = 0; w < kWordBlock; ++w) {
        const std::int32_t similarity = 2 * sums[w] - norm2[block + w];
        if (similarity <= rankings[i].similarity[ranks - 1]) continue;
        rankings[i].Insert(ranks, similarity, block + w);
      }
    }
  }
}

}  // namespace

// The last block is filled with words that lie too far from everything to be found.
Vocabulary::Vocabulary(std::span<const std::int8_t> words, int dim)
    : dim_(dim), size_(static_cast<int>(words.size()) / dim), words_(words.begin(), words.end()) {
  for (std::size_t w = 0; w < words_.size(); w += dim) {
    std::int32_t norm2 = 0;
    for (int i = 0; i < dim; ++i) norm2 += std::int32_t{words_[w + i]} * words_[w + i];
    norm2_.push_back(norm2);
  }
  while (norm2_.size() % kWordBlock != 0) {
    norm2_.push_back(std::numeric_limits<std::int32_t>::max());
    words_.resize(words_.size() + dim, 0);
  }
}

void Vocabulary::NearestWords(std::span<const std::int8_t> descriptors, int words_per_descriptor,
                              std::span<std::uint16_t> words_out) const {
  std::array<std::int16_t, kDescriptorBlock * kMaxDescriptorDim> widened;
  std::array<Ranking, kDescriptorBlock> rankings;
  assert(dim_ <= kMaxDescriptorDim && words_per_descriptor <= std::min(size_, kMaxWordsPerFeature));
  const auto find = dim_ == 64 ? FindNearest<64> : dim_ == 128 ? FindNearest<128> : FindNearest<0>;
  const std::size_t size = descriptors.size() / dim_;
  auto out = words_out.begin();
  for (std::size_t begin = 0; begin < size; begin += kDescriptorBlock) {
    const std::size_t n = std::min<std::size_t>(kDescriptorBlock, size - begin);
    std::copy_n(descriptors.begin() + begin * dim_, n * dim_, widened.begin());
    find(widened.data(), static_cast<int>(n), words_.data(), norm2_.data(),
         static_cast<int>(norm2_.size()), dim_, words_per_descriptor, rankings.data());
    for (std::size_t i = 0; i < n; ++i) {
      out = std::copy_n(rankings[i].word.begin(), words_per_descriptor, out);
    }
  }
}

float MapCount(HistogramMap map, int count, int total) {
  const float share = static_cast<float>(count) / static_cast<float>(total);
  return map == HistogramMap::kHellinger ? std::sqrt(share) : share;
}

HistogramBuilder::HistogramBuilder(int num_words, int max_features, int words_per_feature,
                                   HistogramMap map)
    : map_(map),
      words_per_feature_(words_per_feature),
      max_entries_(std::min(num_words, max_features * words_per_feature)),
      counts_(num_words, 0) {}

Histogram HistogramBuilder::MakeHistogram() const {
  Histogram histogram;
  histogram.words.reserve(max_entries_);
  histogram.counts.reserve(max_entries_);
  histogram.values.reserve(max_entries_);
  return histogram;
}

void HistogramBuilder::Build(std::span<const std::uint16_t> words, Histogram& histogram) {
  histogram.words.clear();
  histogram.counts.clear();
  histogram.values.clear();
  for (std::size_t i = 0; i < words.size(); ++i) {
    std::int32_t& count = counts_[words[i]];
    if (count == 0) histogram.words.push_back(words[i]);
    const int rank = static_cast<int>(i % words_per_feature_);
    count += 1 << (words_per_feature_ - 1 - rank);
  }
  std::sort(histogram.words.begin(), histogram.words.end());
  int total = 0;
  for (const std::uint16_t word : histogram.words) {
    const int count = std::min(counts_[word], 255);
    counts_[word] = 0;
    total += count;
    histogram.counts.push_back(static_cast<std::uint8_t>(count));
  }
  for (const std::uint8_t count : histogram.counts) {
    histogram.values.push_back(MapCount(map_, count, total));
  }
}

}  // namespace viewfix
