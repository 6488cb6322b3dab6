// SPDX-License-Identifier: BSD-3-Clause
#include "platform/daemon/scene_change.h"

#include <cstdlib>

namespace viewfix {
namespace {

constexpr int kMaxDifference = 6;    // grey levels of a cell's mean
constexpr int kMaxChangedCells = 3;  // of 768: a lamp that blinks is no change

}  // namespace

SceneChange::Cells SceneChange::CellsOf(const ImageView& image) {
  Cells cells;
  std::size_t next = 0;
  for (int row = 0; row < kRows; ++row) {
    const int top = image.height * row / kRows, bottom = image.height * (row + 1) / kRows;
    for (int column = 0; column < kColumns; ++column) {
      const int left = image.width * column / kColumns;
      const int right = image.width * (column + 1) / kColumns;
      int sum = 0;
      for (int i = 0; i < kSamples; ++i) {
        const int y = top + (bottom - top) * (i / 4) / 4, x = left + (right - left) * (i % 4) / 4;
        sum += image.Row(y)[x];
      }
      cells[next++] = static_cast<std::int16_t>(sum / kSamples);
    }
  }
  return cells;
}

void SceneChange::SetReference(const ImageView& image) {
  width_ = image.width;
  height_ = image.height;
  reference_ = CellsOf(image);
}

bool SceneChange::Differs(const ImageView& image) const {
  if (image.width != width_ || image.height != height_) return true;
  const Cells cells = CellsOf(image);
  int changed = 0;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (std::abs(cells[i] - reference_[i]) > kMaxDifference) ++changed;
  }
  return changed > kMaxChangedCells;
}

}  // namespace viewfix
