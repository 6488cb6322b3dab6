// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/features/feature_extractor.h"
#include "models/model_view.h"

namespace viewfix {

// What a frame's features say for each location, by the details that the model keeps of it. A
// feature speaks for the location of the detail nearest to its own descriptor, by as much as the
// nearest detail of any other location is farther away:
//   e_l = sum over features i whose nearest location is l of min(d_i2^2, far^2) - d_i1^2
// with d_i1 and d_i2 the distances to the nearest and to the second nearest location. So a door's
// frame, which every floor has, says nothing, and the number on the door much: the local
// naive-Bayes nearest neighbour of [1] with one location for background. Details are looked for
// in the lists of a feature's words, and compared by their codes [2], in integers: the same on
// every processor. Allocates in the constructor only. One instance serves one thread.
// [1] S. McCann, D. Lowe, Local Naive Bayes Nearest Neighbor, CVPR 2012.
// [2] H. Jegou, M. Douze, C. Schmid, Product quantization for nearest neighbor search, PAMI 2011.
class PlaceEvidence {
 public:
  // Details farther than this, of descriptors of length 127, are no match.
  static constexpr std::int32_t kFar = 60;
  // Evidence is counted in squared distances; so many make one.
  static constexpr std::int32_t kUnit = 1000;

  //   words [num_words, dim] of the model's vocabulary
  //   max_features: that Weigh() is given at most
  // Both are borrowed and must outlive this.
  PlaceEvidence(std::span<const std::int8_t> words, int dim, const ModelDetails& details,
                int num_locations, int max_features);

  //   descriptors [n, dim], keypoints [n]
  //   words_of_features [n, words_per_feature] as Vocabulary::NearestWords() gives them
  void Weigh(std::span<const std::int8_t> descriptors, std::span<const Keypoint> keypoints,
             std::span<const std::uint16_t> words_of_features, int words_per_feature);

  // Of the last Weigh(): e_l of every location, and how many features spoke for it.
  std::span<const std::int32_t> evidence() const { return evidence_; }
  std::span<const int> votes() const { return votes_; }

  // [max_features] the location that each of the n features spoke for; -1: none.
  std::span<const int> choices() const { return choices_; }

  // How far the location that most speaks for stands out: (e - e') / sqrt(e), in units, e' the
  // best other location's. Evidence of chance grows as its square root does. Nothing: 0.
  struct Best {
    int location_idx = -1;  // the lowest index among equals; -1: no evidence
    float evidence = 0;     // units
    float rival_evidence = 0;
    float margin = 0;
  };
  Best FindBest() const;

 private:
  void SumNorms();
  void FillTable(const std::int8_t* descriptor);
  void CompareWithList(std::int32_t query_norm2, std::int32_t word_dot, int list);
  int Vote();

  std::span<const std::int8_t> words_;
  int dim_;
  ModelDetails details_;
  std::vector<std::int16_t> codebook_;  // [parts, dim / parts, kCodesOfPart]: codes side by side
  std::vector<std::int32_t> norm2_;     // [details]
  std::vector<std::int32_t> table_;     // [parts, kCodesOfPart] q'c of the feature at hand
  std::vector<std::int32_t> nearest2_;  // [locations] squared distance; kFar^2: none
  std::vector<int> touched_;            // locations that are nearer than that
  std::vector<std::int32_t> evidence_;  // [locations]
  std::vector<int> votes_;              // [locations]
  std::vector<int> choices_;            // [features]
};

}  // namespace viewfix
