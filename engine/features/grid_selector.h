// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "engine/features/feature_extractor.h"

namespace viewfix {

// Keeps the strongest key points of an image, spread over it by a bound: the image
// is divided into square cells for about 8 features each, and no cell gives more
// than 64. A tenth of the features is shared out among the cells first, in whole points
// a cell: with cells of 8 that is mostly none. (Larger shares were less repeatable
// under rotation and JPEG, and made worse visual words.) Equal responses are ordered by
// place, so the choice never depends on the order of Add().
//
// Memory is allocated by the constructor alone. One instance serves one thread.
class GridSelector {
 public:
  // max_image_side and max_features >= 1.
  GridSelector(int max_image_side, int max_features);

  // Forgets all points; the next ones lie in an image of this size, pixels, both
  // sides within 1..max_image_side.
  void Start(int width, int height);

  // Points outside the image count to the nearest cell.
  void Add(const Keypoint& keypoint);

  // Whether a point of a response of at most this much could still be chosen. Where not, it need
  // not be added.
  bool MayChoose(float response) const { return BinOf(response) >= least_bin_; }

  // Clears `selected` (capacity >= max_features) and appends the chosen points:
  // cells row by row, strongest first inside a cell.
  void Select(FeatureSet& selected);

 private:
  // By the exponent and the first three binary digits behind it; the least of all if not > 0.
  static constexpr int kBinShift = 20;
  static constexpr int kBins = 1 << (31 - kBinShift);
  static int BinOf(float response) {
    return response > 0 ? static_cast<int>(std::bit_cast<std::uint32_t>(response) >> kBinShift) : 0;
  }

  Keypoint* CellBegin(int cell);
  int CellIndex(const Keypoint& keypoint) const;
  void Count(float response, int change);
  void RankCells();

  int max_features_;
  int certain_ = 0;    // points that each cell gives, if it has them
  int cell_side_ = 1;  // pixels
  int columns_ = 0;
  int rows_ = 0;
  std::vector<Keypoint> keypoints_;          // [cells][kCellCapacity]
  std::vector<int> sizes_;                   // [cells] points held
  std::vector<int> kept_;                    // [cells] points selected, the strongest ones
  std::vector<const Keypoint*> runners_up_;  // points that no cell keeps for certain
  std::array<int, kBins> counts_{};          // points held, by response
  int least_bin_ = 0;                        // weaker points are not chosen any more
  int held_from_least_bin_ = 0;              // points held in that bin and above
};

}  // namespace viewfix
