// SPDX-License-Identifier: BSD-3-Clause
#include "engine/matching/place_evidence.h"

#include <algorithm>
#include <cmath>

#include "engine/base/cpu_path.h"

namespace viewfix {
namespace {

constexpr std::int32_t kFar2 = PlaceEvidence::kFar * PlaceEvidence::kFar;

std::int32_t Dot(const std::int8_t* a, const std::int8_t* b, int dim) {
  std::int32_t sum = 0;
  for (int i = 0; i < dim; ++i) sum += std::int32_t{a[i]} * b[i];
  return sum;
}

// table[p][c] = x_p'c for all codes c of all parts p of a descriptor x.
//   codes [dim, kCodesOfPart], table [parts, kCodesOfPart]
struct TableKernel {
  VIEWFIX_KERNEL void Run(const std::int8_t* x, int parts, int piece, const std::int16_t* codes,
                          std::int32_t* table) {
    for (int p = 0; p < parts; ++p, table += kCodesOfPart) {
      std::fill_n(table, kCodesOfPart, 0);
      for (int i = 0; i < piece; ++i, codes += kCodesOfPart) {
        const std::int16_t value = x[p * piece + i];
        for (int c = 0; c < kCodesOfPart; ++c) table[c] += std::int32_t{value} * codes[c];
      }
    }
  }
};

// Rotation times x: sums[i] = sum over j of columns[j][i] x_j.
//   columns [dim, dim], sums [dim]
struct TurnKernel {
  VIEWFIX_KERNEL void Run(const std::int8_t* x, int dim, const std::int16_t* columns,
                          std::int32_t* sums) {
    std::fill_n(sums, dim, 0);
    for (int j = 0; j < dim; ++j, columns += dim) {
      const std::int16_t value = x[j];
      for (int i = 0; i < dim; ++i) sums[i] += std::int32_t{value} * columns[i];
    }
  }
};

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

Turner::Turner(std::span<const std::int8_t> rotation, int dim)
    : dim_(dim), path_(BestCpuPath()), columns_(rotation.size()), sums_(dim) {
  for (int i = 0; i < dim; ++i) {
    for (int j = 0; j < dim; ++j) {
      columns_[std::size_t(j) * dim + i] = rotation[std::size_t(i) * dim + j];
    }
  }
}

void Turner::Turn(const std::int8_t* descriptor, std::int8_t* turned) {
  RunOnPath<TurnKernel>(path_, descriptor, dim_, columns_.data(), sums_.data());
  for (int i = 0; i < dim_; ++i) {
    const std::int32_t rounded = (sums_[i] + (sums_[i] < 0 ? -63 : 63)) / 127;
    turned[i] = static_cast<std::int8_t>(std::clamp(rounded, -127, 127));
  }
}

PlaceEvidence::PlaceEvidence(std::span<const std::int8_t> words, int dim,
                             const ModelDetails& details, int num_locations, int max_features)
    : dim_(dim),
      path_(BestCpuPath()),
      details_(details),
      turner_(details.rotation, dim),
      common_(num_locations),
      words_(words.size()),
      codebook_(details.codebook.size()),
      list_begin_(2 * (words.size() / dim) + 1, 0),
      location_(details.size),
      codes_(details.codes.size()),
      norm2_(details.size),
      turned_(dim),
      table_(std::size_t(details.parts) * kCodesOfPart),
      nearest2_(num_locations + 1, kFar2),
      evidence_(num_locations + 1, 0.0F),
      votes_(num_locations + 1, 0),
      choices_(max_features, -1) {
  touched_.reserve(num_locations + 1);
  for (std::size_t w = 0; w < words.size(); w += dim) {
    turner_.Turn(words.data() + w, words_.data() + w);
  }
  const int piece = dim / details.parts;
  for (int p = 0; p < details.parts; ++p) {
    for (int c = 0; c < kCodesOfPart; ++c) {
      for (int i = 0; i < piece; ++i) {
        codebook_[(std::size_t(p) * piece + i) * kCodesOfPart + c] =
            details.codebook[(std::size_t(p) * kCodesOfPart + c) * piece + i];
      }
    }
  }
  ListDetails();
  SumNorms();
}

// The model keeps a location's details together; a feature asks for those of a word.
void PlaceEvidence::ListDetails() {
  const std::size_t lists = list_begin_.size() - 1;
  const auto size_of = [&](int location, std::size_t list) {
    return details_.list_size[location * lists + list];
  };
  for (int l = 0; l <= common_; ++l) {
    for (std::size_t list = 0; list < lists; ++list) list_begin_[list + 1] += size_of(l, list);
  }
  for (std::size_t list = 0; list < lists; ++list) list_begin_[list + 1] += list_begin_[list];
  std::vector<std::uint32_t> next(list_begin_.begin(), list_begin_.end() - 1);
  const std::uint8_t* codes = details_.codes.data();
  for (int l = 0; l <= common_; ++l) {
    for (std::size_t list = 0; list < lists; ++list) {
      const std::size_t bytes = std::size_t(size_of(l, list)) * details_.parts;
      std::copy_n(codes, bytes, codes_.begin() + std::size_t(next[list]) * details_.parts);
      std::fill_n(location_.begin() + next[list], size_of(l, list), static_cast<std::uint16_t>(l));
      next[list] += size_of(l, list);
      codes += bytes;
    }
  }
}

// |w + r|^2 = |w|^2 + sum over parts of 2 w'c + |c|^2.
void PlaceEvidence::SumNorms() {
  const int piece = dim_ / details_.parts;
  std::vector<std::int32_t> code_norm2(table_.size());
  for (std::size_t code = 0; code < code_norm2.size(); ++code) {
    const std::int8_t* centre = details_.codebook.data() + code * piece;
    code_norm2[code] = Dot(centre, centre, piece);
  }
  for (std::size_t list = 0; list + 1 < list_begin_.size(); ++list) {
    if (list_begin_[list] == list_begin_[list + 1]) continue;
    const std::int8_t* word = words_.data() + list / 2 * dim_;
    FillTable(word);
    for (std::size_t code = 0; code < table_.size(); ++code) {
      table_[code] = 2 * table_[code] + code_norm2[code];
    }
    const std::int32_t word_norm2 = Dot(word, word, dim_);
    for (std::uint32_t d = list_begin_[list]; d < list_begin_[list + 1]; ++d) {
      const std::uint8_t* codes = codes_.data() + std::size_t(d) * details_.parts;
      norm2_[d] = word_norm2 + SumCodes<0>(table_.data(), codes, details_.parts);
    }
  }
}

void PlaceEvidence::FillTable(const std::int8_t* descriptor) {
  RunOnPath<TableKernel>(path_, descriptor, details_.parts, dim_ / details_.parts, codebook_.data(),
                         table_.data());
}

void PlaceEvidence::CompareWithList(std::int32_t query_norm2, std::int32_t word_dot, int list) {
  const int parts = details_.parts;
  const std::int32_t base = query_norm2 - 2 * word_dot;
  for (std::uint32_t d = list_begin_[list]; d < list_begin_[list + 1]; ++d) {
    const std::uint8_t* codes = codes_.data() + std::size_t(d) * parts;
    const std::int32_t product = parts == 8 ? SumCodes<8>(table_.data(), codes, parts)
                                            : SumCodes<0>(table_.data(), codes, parts);
    const std::int32_t distance2 = base + norm2_[d] - 2 * product;
    if (distance2 >= kFar2) continue;
    std::int32_t& nearest2 = nearest2_[location_[d]];
    if (nearest2 == kFar2) touched_.push_back(location_[d]);
    nearest2 = std::min(nearest2, std::max(distance2, 0));
  }
}

// Of the feature whose distances are in nearest2_, which is cleared. Returns what it spoke for.
int PlaceEvidence::Vote(int hidden) {
  std::int32_t first2 = kFar2, second2 = kFar2;
  int location = -1;
  for (const int l : touched_) {
    const std::int32_t distance2 = nearest2_[l];
    nearest2_[l] = kFar2;
    if (l == hidden) continue;
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
  const float gap = static_cast<float>(second2 - first2) / kUnit;
  evidence_[location] += gap * std::sqrt(gap);
  ++votes_[location];
  return location;
}

void PlaceEvidence::Weigh(std::span<const std::int8_t> descriptors,
                          std::span<const Keypoint> keypoints,
                          std::span<const std::uint16_t> words_of_features, int words_per_feature,
                          int hidden) {
  std::fill(evidence_.begin(), evidence_.end(), 0.0F);
  std::fill(votes_.begin(), votes_.end(), 0);
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    turner_.Turn(descriptors.data() + i * dim_, turned_.data());
    FillTable(turned_.data());
    const std::int32_t norm2 = Dot(turned_.data(), turned_.data(), dim_);
    const int dark = keypoints[i].laplacian_sign < 0 ? 1 : 0;
    for (int v = 0; v < words_per_feature; ++v) {
      const int word = words_of_features[i * words_per_feature + v];
      const std::int32_t dot = Dot(turned_.data(), words_.data() + std::size_t(word) * dim_, dim_);
      CompareWithList(norm2, dot, 2 * word + dark);
    }
    choices_[i] = Vote(hidden);
  }
}

void ScorePlaces(std::span<const float> evidence, std::span<const float> likeness,
                 float likeness_weight, std::span<float> scores) {
  for (std::size_t l = 0; l < scores.size(); ++l) {
    scores[l] = std::sqrt(evidence[l]) - likeness_weight * likeness[l];
  }
}

BestPlace FindBestPlace(std::span<const float> evidence, std::span<const float> scores) {
  BestPlace best;
  for (int l = 0; l < static_cast<int>(scores.size()); ++l) {
    if (!(evidence[l] > 0)) continue;
    if (best.location_idx < 0 || scores[l] > scores[best.location_idx]) best.location_idx = l;
  }
  if (best.location_idx < 0) return best;
  const float* other = nullptr;
  for (const float& score : scores) {
    if (&score == &scores[best.location_idx]) continue;
    if (other == nullptr || score > *other) other = &score;
  }
  best.margin = other == nullptr ? 0.0F : std::max(scores[best.location_idx] - *other, 0.0F);
  return best;
}

}  // namespace viewfix
