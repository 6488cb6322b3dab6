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

constexpr std::int32_t kNothing = std::numeric_limits<std::int32_t>::min();  // is as unlike

// The most similar words of one descriptor so far, best first; the lower index first among equals.
struct Ranking {
  std::array<std::int32_t, kMaxWordsPerFeature> similarity;
  std::array<std::uint16_t, kMaxWordsPerFeature> word;

  bool ComesBefore(std::int32_t new_similarity, std::uint16_t new_word, int rank) const {
    return new_similarity > similarity[rank] ||
           (new_similarity == similarity[rank] && new_word < word[rank]);
  }

  // If it comes before the last of `ranks`.
  void Take(int ranks, std::int32_t new_similarity, std::uint16_t new_word) {
    int r = ranks - 1;
    if (!ComesBefore(new_similarity, new_word, r)) return;
    for (; r > 0 && ComesBefore(new_similarity, new_word, r - 1); --r) {
      similarity[r] = similarity[r - 1];
      word[r] = word[r - 1];
    }
    similarity[r] = new_similarity;
    word[r] = new_word;
  }

  // What is not above it cannot come before the last of `ranks`: as similar words may.
  std::int32_t Limit(int ranks) const {
    return similarity[ranks - 1] == kNothing ? kNothing : similarity[ranks - 1] - 1;
  }
};

}  // namespace

// Words lie in order of their length, so that few blocks hold long ones (DotTile sums those more
// slowly on some paths). The last block is filled with what lies too far from everything.
Vocabulary::Vocabulary(std::span<const std::int8_t> words, int dim, CpuPath path)
    : dim_(dim),
      size_(static_cast<int>(words.size()) / dim),
      tile_(dim, path),
      word_at_(size_),
      norm2_(size_) {
  const auto word = [&](int w) { return words.subspan(std::size_t(w) * dim, dim); };
  std::vector<std::int32_t> norm2(size_);
  for (int w = 0; w < size_; ++w) {
    norm2[w] = std::inner_product(word(w).begin(), word(w).end(), word(w).begin(), 0);
  }
  std::iota(word_at_.begin(), word_at_.end(), std::uint16_t{0});
  std::ranges::stable_sort(word_at_, {}, [&](std::uint16_t w) { return norm2[w]; });
  std::vector<std::int8_t> in_order;
  for (int i = 0; i < size_; ++i) {
    in_order.insert(in_order.end(), word(word_at_[i]).begin(), word(word_at_[i]).end());
    norm2_[i] = norm2[word_at_[i]];
  }
  words_ = tile_.PackBlocks(in_order);
  const std::size_t rows = words_.size() / tile_.block_bytes() * kTileRows;
  word_at_.resize(rows, 0);
  norm2_.resize(rows, std::numeric_limits<std::int32_t>::max());
}

void Vocabulary::NearestWords(std::span<const std::int8_t> descriptors, int words_per_descriptor,
                              std::span<std::uint16_t> words_out) const {
  std::array<std::uint8_t, DotTile::kMaxTileBytes> queries{};
  DotTile::Likeness similarity;
  std::array<std::int32_t, kTileQueries> limits;
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
    for (int i = 0; i < n; ++i) rankings[i].similarity.fill(kNothing);
    limits.fill(std::numeric_limits<std::int32_t>::max());
    std::fill_n(limits.begin(), n, kNothing);
    const auto next = [&](int b) {
      return tile_.FindAbove(queries.data(), blocks, b, limits.data(), similarity);
    };
    for (int b = next(0); b < blocks.size; b = next(b + 1)) {
      for (int i = 0; i < n; ++i) {
        if (similarity.above[i] == 0) continue;
        for (std::uint32_t bits = similarity.above[i]; bits != 0; bits &= bits - 1) {
          const int row = std::countr_zero(bits);
          rankings[i].Take(words_per_descriptor, similarity.of_query[i][row],
                           word_at_[b * kTileRows + row]);
        }
        limits[i] = rankings[i].Limit(words_per_descriptor);
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
