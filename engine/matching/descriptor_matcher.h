// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/cpu_path.h"
#include "engine/base/status.h"
#include "engine/matching/dot_tile.h"

namespace viewfix {

// Descriptors of one image or of a set of landmarks.
struct DescriptorSet {
  std::span<const std::int8_t> descriptors;  // [n, dim]
  // [n] of Keypoint::laplacian_sign: only equal signs are compared. Empty on either side: all
  // are compared with all.
  std::span<const std::int8_t> signs = {};
};

// Squared Euclidean distances of a query to its nearest candidates.
struct NearestTwo {
  static constexpr std::int32_t kNone = 1 << 29;  // above any distance

  int candidate_idx = -1;  // the lowest index among equals; -1: nothing to compare with
  std::int32_t distance2 = kNone;
  std::int32_t second_distance2 = kNone;
};

struct MatchOptions {
  // Greatest ratio of the distances to the nearest and the second nearest, 0..1; 1: no test.
  float max_ratio = 0.8F;
  // The query must be the nearest of its candidate, too.
  bool mutual = true;

  Status Validate() const;
};

struct DescriptorMatch {
  int query_idx = 0;
  int candidate_idx = 0;
  std::int32_t distance2 = 0;
};

// Exact nearest neighbours among descriptors, by blocks of dot products in integers: the same
// on every processor. Allocates in the constructor only. One instance serves one thread.
class DescriptorMatcher {
 public:
  // dim in 1..128
  DescriptorMatcher(int max_queries, int max_candidates, int dim, CpuPath path = BestCpuPath());

  // The two nearest candidates of each query: nearest_out [queries]. kInvalidArgument: sizes
  // that are no multiple of dim or do not agree; kResourceExhausted: more than the capacity.
  Status FindNearest(const DescriptorSet& queries, const DescriptorSet& candidates,
                     std::span<NearestTwo> nearest_out);

  // Pairs that pass the options, by query_idx: returns how many of `matches_out`, which has
  // room for one a query. Errors as above, and those of MatchOptions::Validate().
  Result<int> Match(const DescriptorSet& queries, const DescriptorSet& candidates,
                    const MatchOptions& options, std::span<DescriptorMatch> matches_out);

 private:
  static constexpr int kSigns = 3;

  // One side, ordered by sign and packed for tile_; each sign begins at a multiple of a block, and
  // what fills up the block before it is farther away than anything.
  struct Side {
    Side(int capacity, std::size_t bytes_per_block);
    // pack   writes a descriptor as number `row` of the packed ones
    template <typename Pack>
    void Fill(const DescriptorSet& set, bool use_signs, int dim, const Pack& pack);

    std::vector<std::uint8_t> packed;  // [capacity + filling] queries, or rows in blocks
    std::vector<std::int32_t> norm2;   // [same]
    std::vector<int> idx;              // [same] of the caller
    int begin[kSigns + 1] = {};        // of each sign's rows
  };

  Status Check(const DescriptorSet& set, int capacity) const;
  void Compare();
  void CompareTile(int q, int c);

  int dim_;
  int max_queries_;
  int max_candidates_;
  CpuPath path_;
  DotTile tile_;
  Side queries_;
  Side candidates_;
  std::vector<NearestTwo> nearest_;           // [query rows]
  std::vector<std::int32_t> best_distance2_;  // [candidate rows]
  std::vector<int> best_query_;               // [candidate rows] caller's index
  std::vector<NearestTwo> by_query_;          // [max_queries]
  std::vector<int> best_of_candidate_;        // [max_candidates]
};

}  // namespace viewfix
