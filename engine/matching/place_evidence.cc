// SPDX-License-Identifier: BSD-3-Clause
#include "engine/matching/place_evidence.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <limits>
#include <numeric>

#include "engine/base/cpu_path.h"

namespace viewfix {
namespace {

constexpr std::int32_t kFar2 = PlaceEvidence::kFar * PlaceEvidence::kFar;
constexpr std::int32_t kClose2 = PlaceEvidence::kClose * PlaceEvidence::kClose;
constexpr int kFirstBlocks = 1;  // of a list, scanned at once
constexpr std::int32_t kLong2 = std::numeric_limits<std::uint16_t>::max();

std::int32_t Dot(const std::int8_t* a, const std::int8_t* b, int dim) {
  std::int32_t sum = 0;
  for (int i = 0; i < dim; ++i) sum += std::int32_t{a[i]} * b[i];
  return sum;
}

// Sums of a tile, as Turner says.
//   sums [kTileQueries, kTileRows]   turned [n, dim]
struct RoundKernel {
  VIEWFIX_KERNEL void Run(const std::int32_t* sums, int n, int rows, int dim, std::int8_t* turned) {
    for (int q = 0; q < n; ++q) {
      std::array<std::int32_t, kTileRows> rounded;
      for (int r = 0; r < kTileRows; ++r) {
        const std::int32_t sum = sums[q * kTileRows + r];
        rounded[r] = std::clamp((sum + (sum < 0 ? -63 : 63)) / 127, -127, 127);
      }
      for (int r = 0; r < rows; ++r) turned[q * dim + r] = static_cast<std::int8_t>(rounded[r]);
    }
  }
};

// The sum of what a detail's codes stand for; the codes of its parts lie `stride` apart.
std::int32_t SumCodes(const std::int32_t* table, const std::uint8_t* codes, std::size_t stride,
                      int parts) {
  std::int32_t sum = 0;
  for (int p = 0; p < parts; ++p) sum += table[p * kCodesOfPart + codes[p * stride]];
  return sum;
}

}  // namespace

Turner::Turner(std::span<const std::int8_t> rotation, int dim, CpuPath path)
    : dim_(dim),
      turned_dim_(static_cast<int>(rotation.size()) / dim),
      path_(path),
      tile_(dim, path),
      rows_(tile_.PackBlocks(rotation)) {}

void Turner::Turn(std::span<const std::int8_t> descriptors, std::int8_t* turned) const {
  std::array<std::uint8_t, DotTile::kMaxTileBytes> queries{};
  std::array<std::int32_t, kTileQueries * kTileRows> sums;
  const int size = static_cast<int>(descriptors.size()) / dim_;
  for (int begin = 0; begin < size; begin += kTileQueries) {
    const int n = std::min(kTileQueries, size - begin);
    tile_.PackQueries(descriptors.subspan(std::size_t(begin) * dim_, std::size_t(n) * dim_),
                      queries.data());
    for (int row = 0; row < turned_dim_; row += kTileRows) {
      tile_.Products(queries.data(), &rows_[row / kTileRows * tile_.block_bytes()], sums.data());
      RunOnPath<RoundKernel>(path_, sums.data(), n, std::min(kTileRows, turned_dim_ - row),
                             turned_dim_, turned + std::size_t(begin) * turned_dim_ + row);
    }
  }
}

PlaceEvidence::PlaceEvidence(std::span<const std::int8_t> words, int dim,
                             const ModelDetails& details, int num_locations, int max_features,
                             CpuPath path)
    : details_(details),
      turner_(details.rotation, dim, path),
      dim_(turner_.turned_dim()),
      common_(num_locations),
      tables_(details.codebook, details.parts, dim_, path),
      words_(words.size() / dim * dim_),
      list_begin_(2 * (words.size() / dim) + 1, 0),
      location_(details.size),
      turned_(std::size_t(max_features) * dim_),
      evidence_(num_locations + 1, 0.0F),
      votes_(num_locations + 1, 0),
      close_votes_(num_locations + 1, 0),
      choices_(max_features, -1) {
  const std::size_t blocks = (std::size_t(details.size) + kScanBlock - 1) / kScanBlock;
  codes_.resize(blocks * kScanBlock * details.parts);
  norm2_.resize(blocks * kScanBlock);
  if (CodeScan::Has(path)) scan_.emplace(details.parts, path);
  turner_.Turn(words, words_.data());
  ListDetails();
  SumNorms();
}

// Where they are scanned, in blocks, part after part.
std::size_t PlaceEvidence::CodeAt(std::uint32_t detail, int part) const {
  if (!scan_) return std::size_t{detail} * details_.parts + part;
  const std::size_t row = std::size_t{detail / kScanBlock} * details_.parts + part;
  return row * kScanBlock + ScanPlace(static_cast<int>(detail % kScanBlock));
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
      for (int i = 0; i < size_of(l, list); ++i) {
        const std::uint32_t detail = next[list]++;
        location_[detail] = static_cast<std::uint16_t>(l);
        for (int p = 0; p < details_.parts; ++p) codes_[CodeAt(detail, p)] = *codes++;
      }
    }
  }
}

// |w + r|^2 = |w|^2 + sum over parts of 2 w'c + |c|^2.
void PlaceEvidence::SumNorms() {
  const int parts = details_.parts, piece = dim_ / parts;
  std::vector<std::int32_t> code_norm2(std::size_t(parts) * kCodesOfPart);
  for (std::size_t code = 0; code < code_norm2.size(); ++code) {
    const std::int8_t* centre = details_.codebook.data() + code * piece;
    code_norm2[code] = Dot(centre, centre, piece);
  }
  for (auto part = code_norm2.begin(); part != code_norm2.end(); part += kCodesOfPart) {
    longest2_ += *std::max_element(part, part + kCodesOfPart);
  }
  std::vector<std::int32_t> table(code_norm2.size());
  const int num_words = static_cast<int>(words_.size()) / dim_;
  for (int w = 0; w < num_words; ++w) {
    const auto from_word = std::span(words_).subspan(std::size_t(w) * dim_);
    if (w % kTileQueries == 0) {
      tables_.Fill(from_word.first(std::size_t(std::min(kTileQueries, num_words - w)) * dim_));
    }
    const std::int32_t* const products = tables_.Of(w % kTileQueries);
    for (std::size_t code = 0; code < table.size(); ++code) {
      table[code] = 2 * products[code] + code_norm2[code];
    }
    const std::int32_t word_norm2 = Dot(from_word.data(), from_word.data(), dim_);
    for (std::uint32_t d = list_begin_[2 * w]; d < list_begin_[2 * w + 2]; ++d) {
      const std::int32_t norm2 =
          word_norm2 + SumCodes(table.data(), &codes_[CodeAt(d, 0)], CodeStride(), parts);
      norm2_[d] = static_cast<std::uint16_t>(std::min(norm2, kLong2));
      if (norm2 >= kLong2) long_.push_back({d, norm2});
    }
  }
}

std::int32_t PlaceEvidence::Norm2(std::uint32_t detail) const {
  if (norm2_[detail] < kLong2) return norm2_[detail];
  return std::ranges::lower_bound(long_, detail, {}, &LongDetail::detail)->norm2;
}

// Whether all products can be scanned: |q'r| <= |q| |r|. Real descriptors' are far from it.
bool PlaceEvidence::FitsScan(std::int32_t query_norm2) const {
  constexpr std::int64_t kMaxSum = CodeScan::kMaxSum;
  return query_norm2 * longest2_ <= kMaxSum * kMaxSum;
}

// Whatever is not nearer than the second nearest location cannot change the vote.
void PlaceEvidence::Take(std::uint32_t detail, std::int32_t distance2, int hidden) {
  distance2 = std::max(distance2, 0);
  const int location = location_[detail];
  if (distance2 >= nearest_.second_distance2 || location == hidden) return;
  if (location == nearest_.location) {
    nearest_.distance2 = std::min(nearest_.distance2, distance2);
  } else if (distance2 < nearest_.distance2) {
    nearest_ = {distance2, nearest_.distance2, location};
  } else {
    nearest_.second_distance2 = distance2;
  }
}

//   base  |q|^2 - 2 q'w of the feature q and the list's word w
void PlaceEvidence::CompareEach(std::int32_t base, const std::uint32_t* list, int hidden) {
  if (scan_) {  // a rare descriptor that cannot be scanned
    for (std::uint32_t d = list[0]; d < list[1]; ++d) Compare(base, d, hidden);
    return;
  }
  switch (details_.parts) {  // those that `train` makes are unrolled
    case 8:
      return CompareEachOf<8>(base, list, hidden);
    case 6:
      return CompareEachOf<6>(base, list, hidden);
    case 5:
      return CompareEachOf<5>(base, list, hidden);
    case 4:
      return CompareEachOf<4>(base, list, hidden);
    default:
      return CompareEachOf<0>(base, list, hidden);
  }
}

// Of codes that lie side by side. kParts: as many as there are, or 0
template <int kParts>
void PlaceEvidence::CompareEachOf(std::int32_t base, const std::uint32_t* list, int hidden) {
  const int parts = kParts == 0 ? details_.parts : kParts;
  const std::int32_t* const table = table_;
  const std::uint8_t* codes = codes_.data() + std::size_t{list[0]} * parts;
  for (std::uint32_t d = list[0]; d < list[1]; ++d, codes += parts) {
    const std::int32_t rest = base - 2 * SumCodes(table, codes, 1, parts);
    if (rest + norm2_[d] >= nearest_.second_distance2) continue;
    Take(d, rest + Norm2(d), hidden);
  }
}

void PlaceEvidence::Compare(std::int32_t base, std::uint32_t detail, int hidden) {
  const std::int32_t product =
      SumCodes(table_, &codes_[CodeAt(detail, 0)], CodeStride(), details_.parts);
  const std::int32_t distance2 = base + Norm2(detail) - 2 * product;
  if (distance2 < nearest_.second_distance2) Take(detail, distance2, hidden);
}

// The same, by blocks: those whose product q'r is too small for their length are passed over. The
// first few are scanned by themselves: what is nearest among them tells which others matter.
void PlaceEvidence::CompareBlocks(std::int32_t base, const std::uint32_t* list, int hidden) {
  const std::uint32_t begin = list[0], end = list[1];
  std::array<std::uint64_t, CodeScan::kMaxBlocks> found;
  std::uint32_t first = begin / kScanBlock * kScanBlock;
  for (int together = kFirstBlocks; first < end; first += together * kScanBlock, together *= 2) {
    together = std::min({together, CodeScan::kMaxBlocks,
                         static_cast<int>((end - first + kScanBlock - 1) / kScanBlock)});
    // base + |r|^2 - 2 q'r < second^2, with |r|^2 rounded down.
    const std::int32_t least = ((base - nearest_.second_distance2) >> 1) + 1;
    scan_->Scan(&codes_[std::size_t(first) * details_.parts], &norm2_[first], together, least,
                found.data());
    for (int b = 0; b < together; ++b) {
      for (std::uint64_t bits = found[b]; bits != 0; bits &= bits - 1) {
        const int i = b * kScanBlock + std::countr_zero(bits);
        const std::uint32_t d = first + i;
        if (d < begin || d >= end) continue;
        if (base + norm2_[d] - 2 * scan_->AtMost(i) >= nearest_.second_distance2) continue;
        Compare(base, d, hidden);
      }
    }
  }
}

// Of the feature whose nearest locations are in nearest_. Returns what it spoke for.
int PlaceEvidence::Vote() {
  if (nearest_.distance2 == nearest_.second_distance2) return -1;
  const float gap = static_cast<float>(nearest_.second_distance2 - nearest_.distance2) / kUnit;
  evidence_[nearest_.location] += gap * std::sqrt(gap);
  ++votes_[nearest_.location];
  if (nearest_.distance2 < kClose2) ++close_votes_[nearest_.location];
  return nearest_.location;
}

void PlaceEvidence::Weigh(std::span<const std::int8_t> descriptors,
                          std::span<const Keypoint> keypoints,
                          std::span<const std::uint16_t> words_of_features, int words_per_feature,
                          int hidden) {
  std::fill(evidence_.begin(), evidence_.end(), 0.0F);
  std::fill(votes_.begin(), votes_.end(), 0);
  std::fill(close_votes_.begin(), close_votes_.end(), 0);
  turner_.Turn(descriptors, turned_.data());
  const std::size_t size = keypoints.size();
  std::size_t w = 0;
  for (std::size_t i = 0; i < size; ++i) {
    const auto descriptor = std::span(turned_).subspan(i * dim_);
    if (i % kTileQueries == 0) {
      tables_.Fill(descriptor.first(std::min<std::size_t>(kTileQueries, size - i) * dim_));
    }
    table_ = tables_.Of(static_cast<int>(i % kTileQueries));
    const std::int32_t norm2 = Dot(descriptor.data(), descriptor.data(), dim_);
    const bool scanned = scan_ && FitsScan(norm2);
    if (scanned) scan_->SetTable(table_);
    nearest_ = {kFar2, kFar2, -1};
    const std::size_t dark = keypoints[i].laplacian_sign < 0 ? 1 : 0;
    for (int v = 0; v < words_per_feature; ++v, ++w) {
      const std::size_t word = words_of_features[w];
      const std::int32_t dot = Dot(descriptor.data(), words_.data() + word * dim_, dim_);
      const std::uint32_t* const list = &list_begin_[2 * word + dark];
      if (scanned) {
        CompareBlocks(norm2 - 2 * dot, list, hidden);
      } else {
        CompareEach(norm2 - 2 * dot, list, hidden);
      }
    }
    choices_[i] = Vote();
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

float LeadOf(float margin, int close_votes, float close_weight) {
  return margin + close_weight * std::sqrt(static_cast<float>(close_votes));
}

}  // namespace viewfix
