// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/base/cpu_path.h"
#include "engine/features/feature_extractor.h"
#include "engine/matching/code_scan.h"
#include "engine/matching/code_tables.h"
#include "engine/matching/dot_tile.h"
#include "models/model_view.h"

namespace viewfix {

// Descriptors as the details' codes see them: rotation * descriptor / 127, rounded, cut to a byte;
// in as many numbers as the rotation has rows.
// Exact in integers. Allocates in the constructor only. Thread-safe.
class Turner {
 public:
  //   rotation [turned dim, dim], copied; dim in 1..128
  Turner(std::span<const std::int8_t> rotation, int dim, CpuPath path = BestCpuPath());
  int turned_dim() const { return turned_dim_; }
  //   descriptors [n, dim], turned [n, turned dim]
  void Turn(std::span<const std::int8_t> descriptors, std::int8_t* turned) const;

 private:
  int dim_;
  int turned_dim_;
  CpuPath path_;
  DotTile tile_;
  std::vector<std::uint8_t> rows_;  // the rotation's, in the tile's blocks
};

// What a frame's features say for each location, by the details that the model keeps of it. A
// feature speaks for the location of the detail nearest to its own descriptor, by how much farther
// away the nearest detail of any other location is:
//   e_l = sum over features i whose nearest location is l of g_i sqrt(g_i),
//   g_i = min(d_i2^2, far^2) - d_i1^2
// with d_i1 and d_i2 the distances to the nearest and to the second nearest location. So a door's
// frame, which every floor has, says nothing, and the number on the door much: the local
// naive-Bayes nearest neighbour of [1] with one location for background. Where the nearest is one
// of the common details, which many locations have, the feature says nothing. The power 3/2 lets
// one clear feature outweigh many small differences, which a like viewpoint alone makes. Details
// are looked for in the lists of a feature's words, and compared by their codes [2] of turned
// descriptors [3], in integers; what they say is summed in the features' order: the same on every
// processor. Allocates in the constructor only. One instance serves one thread.
// [1] S. McCann, D. Lowe, Local Naive Bayes Nearest Neighbor, CVPR 2012.
// [2] H. Jegou, M. Douze, C. Schmid, Product quantization for nearest neighbor search, PAMI 2011.
// [3] T. Ge, K. He, Q. Ke, J. Sun, Optimized Product Quantization, CVPR 2013.
class PlaceEvidence {
 public:
  // Details farther than this, of descriptors of length 127, are no match.
  static constexpr std::int32_t kFar = 60;
  // Details closer than this are likely the feature's own, seen before.
  static constexpr std::int32_t kClose = 40;
  // g of one unit, in squared distances.
  static constexpr float kUnit = 1000;

  //   words [num_words, dim] of the model's vocabulary
  //   details  borrowed: must outlive this
  //   max_features: that Weigh() is given at most
  PlaceEvidence(std::span<const std::int8_t> words, int dim, const ModelDetails& details,
                int num_locations, int max_features, CpuPath path = BestCpuPath());

  //   descriptors [n, dim], keypoints [n]
  //   words_of_features [n, words_per_feature] as Vocabulary::NearestWords() gives them
  //   hidden  as if the model had no such location; -1: none is hidden
  void Weigh(std::span<const std::int8_t> descriptors, std::span<const Keypoint> keypoints,
             std::span<const std::uint16_t> words_of_features, int words_per_feature,
             int hidden = -1);

  // Of the last Weigh(): e_l of every location, and how many features spoke for it.
  std::span<const float> evidence() const { return {evidence_.data(), std::size_t(common_)}; }
  std::span<const int> votes() const { return {votes_.data(), std::size_t(common_)}; }
  // How many of those have a detail closer than kClose.
  std::span<const int> close_votes() const { return {close_votes_.data(), std::size_t(common_)}; }

  // [max_features] the location that each of the n features spoke for, one behind the last for the
  // common details; -1: none.
  std::span<const int> choices() const { return choices_; }

 private:
  // The nearest and the second nearest location of one feature.
  struct Nearest {
    std::int32_t distance2 = 0;         // squared; kFar^2: none
    std::int32_t second_distance2 = 0;  // of the nearest of another location
    int location = -1;
  };

  struct LongDetail {
    std::uint32_t detail;
    std::int32_t norm2;
  };

  std::int32_t Norm2(std::uint32_t detail) const;
  std::size_t CodeAt(std::uint32_t detail, int part) const;
  std::size_t CodeStride() const { return scan_ ? kScanBlock : 1; }  // from part to part
  void ListDetails();
  void SumNorms();
  bool FitsScan(std::int32_t query_norm2) const;
  void Take(std::uint32_t detail, std::int32_t distance2, int hidden);
  void Compare(std::int32_t base, std::uint32_t detail, int hidden);
  void CompareEach(std::int32_t base, const std::uint32_t* list, int hidden);
  template <int kParts>
  void CompareEachOf(std::int32_t base, const std::uint32_t* list, int hidden);
  void CompareBlocks(std::int32_t base, const std::uint32_t* list, int hidden);
  int Vote();

  std::optional<CodeScan> scan_;  // none: details are compared one by one
  ModelDetails details_;
  Turner turner_;
  int dim_;     // of what turner_ gives
  int common_;  // stands for the common details: one behind the locations
  CodeTables tables_;
  std::vector<std::int8_t> words_;         // [words, dim] turned
  std::int64_t longest2_ = 0;              // squared length of the longest that codes stand for
  std::vector<std::uint32_t> list_begin_;  // [2 words + 1] into the details, by list
  std::vector<std::uint16_t> location_;    // [details]
  std::vector<std::uint8_t> codes_;        // [details, parts], as CodeAt() says
  std::vector<std::uint16_t> norm2_;       // [details] squared length, cut to 16 bits
  std::vector<LongDetail> long_;           // those whose is cut, ascending
  std::vector<std::int8_t> turned_;        // [features, dim]
  const std::int32_t* table_ = nullptr;    // of the feature at hand, in tables_
  Nearest nearest_;                        // the same
  std::vector<float> evidence_;            // [locations + 1]
  std::vector<int> votes_;                 // [locations + 1]
  std::vector<int> close_votes_;           // [locations + 1]
  std::vector<int> choices_;               // [features]
};

// How far each location's evidence goes beyond what a like view would give it:
//   s_l = sqrt(e_l) - likeness_weight * likeness_l
//   evidence, likeness, scores [locations]
void ScorePlaces(std::span<const float> evidence, std::span<const float> likeness,
                 float likeness_weight, std::span<float> scores);

// The location of which evidence speaks and whose score is highest, and the lead over the best
// other. The lowest index among equals; -1 and 0 where there is no evidence.
struct BestPlace {
  int location_idx = -1;
  float margin = 0;
};
BestPlace FindBestPlace(std::span<const float> evidence, std::span<const float> scores);

// What the confidence is a curve of: a place that the model does not know may lead, but few of its
// features are close to details.
//   close_votes   of the best place
//   close_weight  what their root counts for, in units of the margin
float LeadOf(float margin, int close_votes, float close_weight);

}  // namespace viewfix
