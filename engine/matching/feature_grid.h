// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <vector>

#include "engine/features/feature_extractor.h"

namespace viewfix {

// The key points of one frame by where they are. Allocates in the constructor only. One
// instance serves one thread.
class FeatureGrid {
 public:
  explicit FeatureGrid(int max_features);

  // Takes the key points of a frame; points that are not finite are left out.
  void Fill(std::span<const Keypoint> keypoints);

  // Calls visit(index) for every key point that may lie within `radius` pixels of (x, y): all
  // that do, and some that do not. By rows of cells, index ascending inside a cell.
  template <typename Visit>
  void ForEachNear(double x, double y, double radius, Visit visit) const {
    const int column_end = CellOf(x + radius) + 1;
    const int row_end = CellOf(y + radius) + 1;
    for (int row = CellOf(y - radius); row < row_end; ++row) {
      for (int column = CellOf(x - radius); column < column_end; ++column) {
        const int cell = row * kCells + column;
        for (int i = begin_[cell]; i < begin_[cell + 1]; ++i) visit(order_[i]);
      }
    }
  }

 private:
  static constexpr int kCells = 64;     // across and down
  static constexpr int kCellSide = 16;  // pixels: frames are 640 to 1024 pixels wide, mostly

  // The column or row, inside the grid: points beyond its edge count to the last cell.
  static int CellOf(double coordinate);

  std::vector<int> begin_;  // [cells + 1] into order_
  std::vector<int> order_;  // key points by cell
  std::vector<int> cell_;   // [key points]; -1: left out
};

}  // namespace viewfix
