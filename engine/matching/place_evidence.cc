// SPDX-License-Identifier: BSD-3-Clause
#include "engine/matching/place_evidence.h"

#include <algorithm>
#include <cmath>

namespace viewfix {
namespace {

constexpr std::int32_t kFar2 = PlaceEvidence::kFar * PlaceEvidence::kFar;

std::int32_t Dot(const std::int8_t* a, const std::int8_t* b, int dim) {
  std::int32_t sum = 0;
  for (int i = 0; i < dim; ++i) sum += std::int32_t{a[i]} * b[i];
  return sum;
}

// x'c for all codes c of one part, added to what is in `sums`.
void AddProducts(const std::int8_t* x, int piece, const std::int16_t* codes, std::int32_t* sums) {
  for (int i = 0; i < piece; ++i) {
    const std::int16_t value = x[i];
    const std::int16_t* row = codes + std::size_t(i) * kCodesOfPart;
    for (int c = 0; c < kCodesOfPart; ++c) sums[c] += std::int32_t{value} * row[c];
  }
}

// The sum of what a detail's codes stand for.
//   kParts   where the compiler is to know it and needs no loop; 0: `parts` says
template <int kParts>
std::int32_t SumCodes(const std::int32_t* table, const std::uint8_t* codes, int parts) {
  const int n = kParts > 0 ? kParts : parts;
  std::int32_t sum = 0;
  for (int p = 0; p < n; ++p) sum += table[p * kCodesOfPart + codes[p]];
  return sum;
}

}  // namespace

PlaceEvidence::PlaceEvidence(std::span<const std::int8_t> words, int dim,
                             const ModelDetails& details, int num_locations, int max_features)
    : words_(words),
      dim_(dim),
      details_(details),
      codebook_(details.codebook.size()),
      norm2_(details.size),
      table_(std::size_t(details.parts) * kCodesOfPart),
      nearest2_(num_locations, kFar2),
      evidence_(num_locations, 0),
      votes_(num_locations, 0),
      choices_(max_features, -1) {
  touched_.reserve(num_locations);
  const int piece = dim / details.parts;
  for (int p = 0; p < details.parts; ++p) {
    for (int c = 0; c < kCodesOfPart; ++c) {
      for (int i = 0; i < piece; ++i) {
        codebook_[(std::size_t(p) * piece + i) * kCodesOfPart + c] =
            details.codebook[(std::size_t(p) * kCodesOfPart + c) * piece + i];
      }
    }
  }
  SumNorms();
}

// |w + r|^2 = |w|^2 + sum over parts of 2 w'c + |c|^2.
void PlaceEvidence::SumNorms() {
  const int piece = dim_ / details_.parts;
  std::vector<std::int32_t> code_norm2(table_.size());
  for (std::size_t code = 0; code < code_norm2.size(); ++code) {
    const std::int8_t* centre = details_.codebook.data() + code * piece;
    code_norm2[code] = Dot(centre, centre, piece);
  }
  const int num_words = static_cast<int>(details_.list_begin.size() / 2);
  for (int w = 0; w < num_words; ++w) {
    const std::uint32_t begin = details_.list_begin[2 * std::size_t(w)];
    const std::uint32_t end = details_.list_begin[2 * std::size_t(w) + 2];
    if (begin == end) continue;
    const std::int8_t* word = words_.data() + std::size_t(w) * dim_;
    FillTable(word);
    for (std::size_t code = 0; code < table_.size(); ++code) {
      table_[code] = 2 * table_[code] + code_norm2[code];
    }
    const std::int32_t word_norm2 = Dot(word, word, dim_);
    for (std::uint32_t d = begin; d < end; ++d) {
      const std::uint8_t* codes = details_.codes.data() + std::size_t(d) * details_.parts;
      norm2_[d] = word_norm2 + SumCodes<0>(table_.data(), codes, details_.parts);
    }
  }
}

void PlaceEvidence::FillTable(const std::int8_t* descriptor) {
  const int piece = dim_ / details_.parts;
  std::fill(table_.begin(), table_.end(), 0);
  for (int p = 0; p < details_.parts; ++p) {
    AddProducts(descriptor + p * piece, piece,
                codebook_.data() + std::size_t(p) * piece * kCodesOfPart,
                table_.data() + std::size_t(p) * kCodesOfPart);
  }
}

void PlaceEvidence::CompareWithList(std::int32_t query_norm2, std::int32_t word_dot, int list) {
  const int parts = details_.parts;
  const std::int32_t base = query_norm2 - 2 * word_dot;
  for (std::uint32_t d = details_.list_begin[list]; d < details_.list_begin[list + 1]; ++d) {
    const std::uint8_t* codes = details_.codes.data() + std::size_t(d) * parts;
    const std::int32_t product = parts == 8 ? SumCodes<8>(table_.data(), codes, parts)
                                            : SumCodes<0>(table_.data(), codes, parts);
    const std::int32_t distance2 = base + norm2_[d] - 2 * product;
    if (distance2 >= kFar2) continue;
    std::int32_t& nearest2 = nearest2_[details_.location[d]];
    if (nearest2 == kFar2) touched_.push_back(details_.location[d]);
    nearest2 = std::min(nearest2, std::max(distance2, 0));
  }
}

// Of the feature whose distances are in nearest2_, which is cleared. Returns what it spoke for.
int PlaceEvidence::Vote() {
  std::int32_t first2 = kFar2, second2 = kFar2;
  int location = -1;
  for (const int l : touched_) {
    const std::int32_t distance2 = nearest2_[l];
    nearest2_[l] = kFar2;
    if (distance2 < first2) {
      second2 = first2;
      first2 = distance2;
      location = l;
    } else {
      second2 = std::min(second2, distance2);
    }
  }
  touched_.clear();
  if (first2 == second2) return -1;
  evidence_[location] += second2 - first2;
  ++votes_[location];
  return location;
}

void PlaceEvidence::Weigh(std::span<const std::int8_t> descriptors,
                          std::span<const Keypoint> keypoints,
                          std::span<const std::uint16_t> words_of_features, int words_per_feature) {
  std::fill(evidence_.begin(), evidence_.end(), 0);
  std::fill(votes_.begin(), votes_.end(), 0);
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    const std::int8_t* descriptor = descriptors.data() + i * dim_;
    FillTable(descriptor);
    const std::int32_t norm2 = Dot(descriptor, descriptor, dim_);
    const int dark = keypoints[i].laplacian_sign < 0 ? 1 : 0;
    for (int v = 0; v < words_per_feature; ++v) {
      const int word = words_of_features[i * words_per_feature + v];
      const std::int32_t dot = Dot(descriptor, words_.data() + std::size_t(word) * dim_, dim_);
      CompareWithList(norm2, dot, 2 * word + dark);
    }
    choices_[i] = Vote();
  }
}

PlaceEvidence::Best PlaceEvidence::FindBest() const {
  std::int32_t first = 0, second = 0;
  Best best;
  for (int l = 0; l < static_cast<int>(evidence_.size()); ++l) {
    if (evidence_[l] > first) {
      second = first;
      first = evidence_[l];
      best.location_idx = l;
    } else {
      second = std::max(second, evidence_[l]);
    }
  }
  best.evidence = static_cast<float>(first) / kUnit;
  best.rival_evidence = static_cast<float>(second) / kUnit;
  // Less than a unit is chance.
  if (first > 0) {
    best.margin = (best.evidence - best.rival_evidence) / std::sqrt(std::max(best.evidence, 1.0F));
  }
  return best;
}

}  // namespace viewfix
