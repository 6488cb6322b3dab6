// SPDX-License-Identifier: BSD-3-Clause
#include "engine/matching/descriptor_matcher.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/matching/dot_block.h"

namespace viewfix {
namespace {

constexpr int kCandidateBlock = kDotRows;
constexpr int kQueryBlock = 8;  // these stay in the first cache

// Rows of one sign on either side.
struct Rows {
  const std::int16_t* rows;   // [end, dim]
  const std::int32_t* norm2;  // [end]
  const int* idx;             // [end]
  int begin;
  int end;  // begin plus a multiple of the block
};

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

template <int kDim>
void CompareRows(const Rows& queries, const Rows& candidates, int dim, NearestTwo* nearest,
                 std::int32_t* best_distance2, int* best_query) {
  for (int block = queries.begin; block < queries.end; block += kQueryBlock) {
    for (int c = candidates.begin; c < candidates.end; c += kCandidateBlock) {
      const std::int16_t* rows = candidates.rows + std::size_t(c) * dim;
      for (int q = block; q < block + kQueryBlock; ++q) {
        const auto sums = DotBlock<kDim>(queries.rows + std::size_t(q) * dim, rows, dim);
        for (int i = 0; i < kCandidateBlock; ++i) {
          const std::int32_t distance2 = queries.norm2[q] + candidates.norm2[c + i] - 2 * sums[i];
          Update(nearest[q], distance2, candidates.idx[c + i]);
          if (distance2 >= best_distance2[c + i]) continue;
          best_distance2[c + i] = distance2;
          best_query[c + i] = queries.idx[q];
        }
      }
    }
  }
}

constexpr int RowCapacity(int capacity) { return capacity + 3 * kQueryBlock; }

}  // namespace

Status MatchOptions::Validate() const {
  if (!(max_ratio >= 0 && max_ratio <= 1)) {
    return {StatusCode::kInvalidArgument, "the ratio of distances must be in 0..1"};
  }
  return {};
}

DescriptorMatcher::Side::Side(int capacity, int dim)
    : rows(std::size_t(RowCapacity(capacity)) * dim),
      norm2(RowCapacity(capacity)),
      idx(RowCapacity(capacity)) {}

void DescriptorMatcher::Side::Fill(const DescriptorSet& set, bool use_signs, int dim) {
  const int n = static_cast<int>(set.descriptors.size()) / dim;
  int row = 0;
  for (int sign = 0; sign < kSigns; ++sign) {
    begin[sign] = row;
    for (int i = 0; i < n; ++i) {
      if ((use_signs ? set.signs[i] + 1 : 0) != sign) continue;
      const std::int8_t* descriptor = set.descriptors.data() + std::size_t(i) * dim;
      std::int32_t sum = 0;
      for (int d = 0; d < dim; ++d) sum += std::int32_t{descriptor[d]} * descriptor[d];
      std::copy_n(descriptor, dim, rows.data() + std::size_t(row) * dim);
      norm2[row] = sum;
      idx[row++] = i;
    }
    for (; row % kQueryBlock != 0; ++row) {
      std::fill_n(rows.data() + std::size_t(row) * dim, dim, std::int16_t{0});
      norm2[row] = NearestTwo::kNone;
      idx[row] = -1;
    }
  }
  begin[kSigns] = row;
}

DescriptorMatcher::DescriptorMatcher(int max_queries, int max_candidates, int dim)
    : dim_(dim),
      max_queries_(max_queries),
      max_candidates_(max_candidates),
      queries_(max_queries, dim),
      candidates_(max_candidates, dim),
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
  const auto compare = dim_ == 64    ? CompareRows<64>
                       : dim_ == 128 ? CompareRows<128>
                                     : CompareRows<0>;
  const auto rows = [](const Side& side, int sign) {
    return Rows{side.rows.data(), side.norm2.data(), side.idx.data(), side.begin[sign],
                side.begin[sign + 1]};
  };
  for (int sign = 0; sign < kSigns; ++sign) {
    compare(rows(queries_, sign), rows(candidates_, sign), dim_, nearest_.data(),
            best_distance2_.data(), best_query_.data());
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
  queries_.Fill(queries, use_signs, dim_);
  candidates_.Fill(candidates, use_signs, dim_);
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
