// SPDX-License-Identifier: BSD-3-Clause
#include "engine/matching/feature_grid.h"

#include <algorithm>
#include <cmath>

namespace viewfix {

FeatureGrid::FeatureGrid(int max_features)
    : begin_(kCells * kCells + 1, 0), order_(max_features, 0), cell_(max_features, 0) {}

int FeatureGrid::CellOf(double coordinate) {
  if (!(coordinate > 0)) return 0;
  return static_cast<int>(std::min(coordinate / kCellSide, double{kCells - 1}));
}

void FeatureGrid::Fill(std::span<const Keypoint> keypoints) {
  const int size = static_cast<int>(std::min(keypoints.size(), cell_.size()));
  std::fill(begin_.begin(), begin_.end(), 0);
  for (int i = 0; i < size; ++i) {
    const Keypoint& k = keypoints[i];
    const bool finite = std::isfinite(k.x) && std::isfinite(k.y);
    cell_[i] = finite ? CellOf(k.y) * kCells + CellOf(k.x) : -1;
    if (finite) ++begin_[cell_[i]];
  }
  // Each begin_ is first the end of its cell, and walks to its beginning as the cell fills.
  for (int cell = 1; cell <= kCells * kCells; ++cell) begin_[cell] += begin_[cell - 1];
  for (int i = size - 1; i >= 0; --i) {
    if (cell_[i] >= 0) order_[--begin_[cell_[i]]] = i;
  }
}

}  // namespace viewfix
