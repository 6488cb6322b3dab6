// SPDX-License-Identifier: BSD-3-Clause
#include "engine/matching/descriptor_matcher.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace viewfix {
namespace {

constexpr int kBlock = kTileRows;  // of either side
static_assert(kBlock == kTileQueries);

void Update(NearestTwo& nearest, std::int32_t distance2, int candidate_idx) {
  if (distance2 >= nearest.second_distance2) return;
  if (distance2 < nearest.distance2) {
    nearest.second_distance2 = nearest.distance2;
    nearest.distance2 = distance2;
    nearest.candidate_idx = candidate_idx;
  } else {
    nearest.second_distance2 = distance2;
  }
}

// One query and the candidates of one block. Most are farther than what has been found
// already, which whole vectors see at once.
struct CompareKernel {
  VIEWFIX_KERNEL void Run(const std::int32_t* products, std::int32_t query_norm2, int query_idx,
                          const std::int32_t* norm2, const int* idx, NearestTwo* nearest,
                          std::int32_t* best, int* best_query) {
    std::int32_t* __restrict best_distance2 = best;
    int* __restrict best_idx = best_query;
    std::array<std::int32_t, kBlock> distance2;
    const std::int32_t second = nearest->second_distance2;
    int nearer = 0;
    for (int i = 0; i < kBlock; ++i) {
      distance2[i] = query_norm2 + norm2[i] - 2 * products[i];
      nearer |= distance2[i] < second ? 1 : 0;
      const bool is_best = distance2[i] < best_distance2[i];
      best_distance2[i] = is_best ? distance2[i] : best_distance2[i];
      best_idx[i] = is_best ? query_idx : best_idx[i];
    }
    if (nearer == 0) return;
    for (int i = 0; i < kBlock; ++i) Update(*nearest, distance2[i], idx[i]);
  }
};

constexpr int RowCapacity(int capacity) { return capacity + 3 * kBlock; }

}  // namespace

Status MatchOptions::Validate() const {
  if (!(max_ratio >= 0 && max_ratio <= 1)) {
    return {StatusCode::kInvalidArgument, "the ratio of distances must be in 0..1"};
  }
  return {};
}

DescriptorMatcher::Side::Side(int capacity, std::size_t bytes_per_block)
    : packed((RowCapacity(capacity) + kBlock) / kBlock * bytes_per_block),
      norm2(RowCapacity(capacity)),
      idx(RowCapacity(capacity)) {}

template <typename Pack>
void DescriptorMatcher::Side::Fill(const DescriptorSet& set, bool use_signs, int dim,
                                   const Pack& pack) {
  static constexpr std::array<std::int8_t, kMaxDescriptorDim> kZeros{};
  const int n = static_cast<int>(set.descriptors.size()) / dim;
  int row = 0;
  for (int sign = 0; sign < kSigns; ++sign) {
    begin[sign] = row;
    for (int i = 0; i < n; ++i) {
      if ((use_signs ? set.signs[i] + 1 : 0) != sign) continue;
      const auto descriptor = set.descriptors.subspan(std::size_t(i) * dim, dim);
      std::int32_t sum = 0;
      for (const std::int32_t value : descriptor) sum += value * value;
      pack(descriptor, row, packed.data());
      norm2[row] = sum;
      idx[row++] = i;
    }
    for (; row % kBlock != 0; ++row) {
      pack(std::span(kZeros).first(dim), row, packed.data());
      norm2[row] = NearestTwo::kNone;
      idx[row] = -1;
    }
  }
  begin[kSigns] = row;
}

DescriptorMatcher::DescriptorMatcher(int max_queries, int max_candidates, int dim, CpuPath path)
    : dim_(dim),
      max_queries_(max_queries),
      max_candidates_(max_candidates),
      path_(path),
      tile_(std::clamp(dim, 1, kMaxDescriptorDim), path),  // Check() refuses others
      queries_(max_queries, tile_.tile_bytes()),
      candidates_(max_candidates, tile_.block_bytes()),
      nearest_(RowCapacity(max_queries)),
      best_distance2_(RowCapacity(max_candidates)),
      best_query_(RowCapacity(max_candidates)),
      by_query_(max_queries),
      best_of_candidate_(max_candidates) {}

Status DescriptorMatcher::Check(const DescriptorSet& set, int capacity) const {
  if (dim_ < 1 || dim_ > kMaxDescriptorDim) {
    return {StatusCode::kInvalidArgument, "descriptors have 1..128 dimensions"};
  }
  const std::size_t n = set.descriptors.size() / dim_;
  if (n * dim_ != set.descriptors.size() || (!set.signs.empty() && set.signs.size() != n)) {
    return {StatusCode::kInvalidArgument, "sizes of descriptors and signs do not agree"};
  }
  const auto is_sign = [](std::int8_t sign) { return sign >= -1 && sign <= 1; };
  if (!std::all_of(set.signs.begin(), set.signs.end(), is_sign)) {
    return {StatusCode::kInvalidArgument, "a sign is -1, 0 or 1"};
  }
  if (n > static_cast<std::size_t>(capacity)) {
    return {StatusCode::kResourceExhausted, "more descriptors than the matcher was made for"};
  }
  return {};
}

void DescriptorMatcher::Compare() {
  std::fill_n(nearest_.begin(), queries_.begin[kSigns], NearestTwo{});
  std::fill_n(best_distance2_.begin(), candidates_.begin[kSigns], NearestTwo::kNone);
  std::fill_n(best_query_.begin(), candidates_.begin[kSigns], -1);
  for (int sign = 0; sign < kSigns; ++sign) {
    for (int q = queries_.begin[sign]; q < queries_.begin[sign + 1]; q += kTileQueries) {
      for (int c = candidates_.begin[sign]; c < candidates_.begin[sign + 1]; c += kBlock) {
        CompareTile(q, c);
      }
    }
  }
}

// Queries q .. q + kTileQueries - 1 with candidates c .. c + kBlock - 1.
void DescriptorMatcher::CompareTile(int q, int c) {
  std::array<std::int32_t, kTileQueries * kBlock> products;
  tile_.Products(&queries_.packed[q / kTileQueries * tile_.tile_bytes()],
                 &candidates_.packed[c / kBlock * tile_.block_bytes()], products.data());
  for (int i = 0; i < kTileQueries; ++i) {
    RunOnPath<CompareKernel>(path_, products.data() + i * kBlock, queries_.norm2[q + i],
                             queries_.idx[q + i], candidates_.norm2.data() + c,
                             candidates_.idx.data() + c, &nearest_[q + i],
                             best_distance2_.data() + c, best_query_.data() + c);
  }
}

Status DescriptorMatcher::FindNearest(const DescriptorSet& queries, const DescriptorSet& candidates,
                                      std::span<NearestTwo> nearest_out) {
  if (const Status status = Check(queries, max_queries_); !status.ok()) return status;
  if (const Status status = Check(candidates, max_candidates_); !status.ok()) return status;
  if (nearest_out.size() * dim_ != queries.descriptors.size()) {
    return {StatusCode::kInvalidArgument, "one result for each query"};
  }
  const bool use_signs = !queries.signs.empty() && !candidates.signs.empty();
  const auto pack_query = [this](auto descriptor, int row, std::uint8_t* packed) {
    tile_.PackQuery(descriptor, row % kTileQueries,
                    packed + row / kTileQueries * tile_.tile_bytes());
  };
  const auto pack_in_block = [this](auto descriptor, int row, std::uint8_t* packed) {
    tile_.PackRow(descriptor, row % kBlock, packed + row / kBlock * tile_.block_bytes());
  };
  queries_.Fill(queries, use_signs, dim_, pack_query);
  candidates_.Fill(candidates, use_signs, dim_, pack_in_block);
  Compare();
  for (int row = 0; row < queries_.begin[kSigns]; ++row) {
    if (queries_.idx[row] >= 0) nearest_out[queries_.idx[row]] = nearest_[row];
  }
  return {};
}

Result<int> DescriptorMatcher::Match(const DescriptorSet& queries, const DescriptorSet& candidates,
                                     const MatchOptions& options,
                                     std::span<DescriptorMatch> matches_out) {
  if (const Status status = options.Validate(); !status.ok()) return status;
  const std::size_t n = queries.descriptors.size() / dim_;
  if (n > by_query_.size()) return Check(queries, max_queries_);
  const std::span<NearestTwo> nearest(by_query_.data(), n);
  if (const Status status = FindNearest(queries, candidates, nearest); !status.ok()) return status;
  if (matches_out.size() < n) {
    return Status(StatusCode::kInvalidArgument, "room for one match a query");
  }
  for (int row = 0; row < candidates_.begin[kSigns]; ++row) {
    if (candidates_.idx[row] >= 0) best_of_candidate_[candidates_.idx[row]] = best_query_[row];
  }
  // In integers, so that every processor draws the same line.
  const auto ratio2_q16 =
      static_cast<std::int64_t>(std::lround(double{options.max_ratio} * options.max_ratio * 65536));
  int count = 0;
  for (int q = 0; q < static_cast<int>(n); ++q) {
    const NearestTwo& two = nearest[q];
    if (two.candidate_idx < 0) continue;
    if (options.mutual && best_of_candidate_[two.candidate_idx] != q) continue;
    if (std::int64_t{two.distance2} * 65536 > ratio2_q16 * two.second_distance2) continue;
    matches_out[count++] = {q, two.candidate_idx, two.distance2};
  }
  return count;
}

}  // namespace viewfix
