// SPDX-License-Identifier: BSD-3-Clause
#include "engine/vocabulary/vocabulary.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <limits>
#include <numeric>

namespace viewfix {
namespace {

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

  // Those words of a block, bits of `nearer`, that are more similar. Returns how similar the last
  // of `ranks` is then.
  std::int32_t Take(int ranks, std::uint32_t nearer, const std::int32_t* of_block, int first_word) {
    for (; nearer != 0; nearer &= nearer - 1) {
      const int w = std::countr_zero(nearer);
      if (of_block[w] > similarity[ranks - 1]) Insert(ranks, of_block[w], first_word + w);
    }
    return similarity[ranks - 1];
  }
};

}  // namespace

// The last block is filled with words that lie too far from everything to be found.
Vocabulary::Vocabulary(std::span<const std::int8_t> words, int dim, CpuPath path)
    : dim_(dim), size_(static_cast<int>(words.size()) / dim), tile_(dim, path) {
  const int blocks = (size_ + kTileRows - 1) / kTileRows;
  words_.resize(blocks * tile_.block_bytes());
  norm2_.resize(std::size_t(blocks) * kTileRows, std::numeric_limits<std::int32_t>::max());
  static constexpr std::array<std::int8_t, kMaxDescriptorDim> kZeros{};
  for (int w = 0; w < blocks * kTileRows; ++w) {
    const auto word =
        w < size_ ? words.subspan(std::size_t(w) * dim, dim) : std::span(kZeros).first(dim);
    tile_.PackRow(word, w % kTileRows, &words_[w / kTileRows * tile_.block_bytes()]);
    if (w < size_) norm2_[w] = std::inner_product(word.begin(), word.end(), word.begin(), 0);
  }
}

void Vocabulary::NearestWords(std::span<const std::int8_t> descriptors, int words_per_descriptor,
                              std::span<std::uint16_t> words_out) const {
  std::array<std::uint8_t, DotTile::kMaxTileBytes> queries{};
  DotTile::Likeness similarity;
  std::array<std::int32_t, kTileQueries> worst;  // of what the rankings hold
  std::array<Ranking, kTileQueries> rankings;
  assert(words_per_descriptor <= std::min(size_, kMaxWordsPerFeature));
  const DotTile::Blocks blocks = {words_.data(), norm2_.data(),
                                  static_cast<int>(norm2_.size()) / kTileRows};
  const int size = static_cast<int>(descriptors.size()) / dim_;
  auto out = words_out.begin();
  for (int begin = 0; begin < size; begin += kTileQueries) {
    const int n = std::min(kTileQueries, size - begin);
    tile_.PackQueries(descriptors.subspan(std::size_t(begin) * dim_, std::size_t(n) * dim_),
                      queries.data());
    for (int i = 0; i < n; ++i) {
      rankings[i].similarity.fill(std::numeric_limits<std::int32_t>::min());
    }
    worst.fill(std::numeric_limits<std::int32_t>::max());
    std::fill_n(worst.begin(), n, std::numeric_limits<std::int32_t>::min());
    const auto next = [&](int b) {
      return tile_.FindAbove(queries.data(), blocks, b, worst.data(), similarity);
    };
    for (int b = next(0); b < blocks.size; b = next(b + 1)) {
      for (int i = 0; i < n; ++i) {
        if (similarity.above[i] == 0) continue;
        worst[i] = rankings[i].Take(words_per_descriptor, similarity.above[i],
                                    similarity.of_query[i], b * kTileRows);
      }
    }
    for (int i = 0; i < n; ++i) {
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
