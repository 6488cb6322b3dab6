// SPDX-License-Identifier: BSD-3-Clause
#include "engine/features/grid_selector.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>

namespace viewfix {
namespace {

constexpr float kFeaturesPerCell = 8;  // on average
constexpr int kMinCellSide = 8;        // pixels
constexpr int kCellCapacity = 64;      // no cell gives more
constexpr int kCertainPercent = 10;    // of the features are given out by cell

// A total order: equal only if place, scale and orientation are equal, too.
bool Stronger(const Keypoint& a, const Keypoint& b) {
  if (a.response != b.response) return a.response > b.response;
  if (a.y != b.y) return a.y < b.y;
  if (a.x != b.x) return a.x < b.x;
  if (a.sigma != b.sigma) return a.sigma < b.sigma;
  if (a.cos_angle != b.cos_angle) return a.cos_angle < b.cos_angle;
  return a.sin_angle < b.sin_angle;
}

int CellSide(int width, int height, int max_features) {
  const float pixels = static_cast<float>(width) * static_cast<float>(height);
  const float side = std::sqrt(pixels * kFeaturesPerCell / static_cast<float>(max_features));
  return std::max(kMinCellSide, static_cast<int>(side) + 1);
}

int CellsAcross(int side, int cell_side) { return (side + cell_side - 1) / cell_side; }

// As many cells as an image of any shape can have: whole ones, and cut ones along two
// edges.
std::size_t MaxCells(int max_image_side, int max_features) {
  return static_cast<std::size_t>(max_features / static_cast<int>(kFeaturesPerCell) +
                                  2 * (max_image_side / kMinCellSide) + 2);
}

}  // namespace

GridSelector::GridSelector(int max_image_side, int max_features) : max_features_(max_features) {
  const std::size_t cells = MaxCells(max_image_side, max_features);
  keypoints_.resize(cells * kCellCapacity);
  sizes_.resize(cells);
  kept_.resize(cells);
  runners_up_.reserve(cells * kCellCapacity);
}

void GridSelector::Start(int width, int height) {
  cell_side_ = CellSide(width, height, max_features_);
  columns_ = CellsAcross(width, cell_side_);
  rows_ = CellsAcross(height, cell_side_);
  assert(std::size_t(columns_) * std::size_t(rows_) <= sizes_.size());
  certain_ = max_features_ * kCertainPercent / (100 * columns_ * rows_);
  std::fill(sizes_.begin(), sizes_.end(), 0);
  counts_.fill(0);
  least_bin_ = held_from_least_bin_ = 0;
}

Keypoint* GridSelector::CellBegin(int cell) {
  return keypoints_.data() + std::size_t(cell) * kCellCapacity;
}

int GridSelector::CellIndex(const Keypoint& keypoint) const {
  const int column = std::clamp(static_cast<int>(keypoint.x) / cell_side_, 0, columns_ - 1);
  const int row = std::clamp(static_cast<int>(keypoint.y) / cell_side_, 0, rows_ - 1);
  return row * columns_ + column;
}

void GridSelector::Add(const Keypoint& keypoint) {
  const int cell = CellIndex(keypoint);
  Keypoint* begin = CellBegin(cell);
  int& size = sizes_[cell];
  // A heap with the weakest point on top, which gives way when the cell is full.
  if (size == kCellCapacity) {
    if (!Stronger(keypoint, *begin)) return;
    Count(begin->response, -1);
    std::pop_heap(begin, begin + size, Stronger);
    --size;
  }
  begin[size++] = keypoint;
  std::push_heap(begin, begin + size, Stronger);
  Count(keypoint.response, 1);
}

// Points give way to stronger ones only, so once enough are above a bin, it is out for good; but
// for a cell's certain points, which are chosen however weak they are.
void GridSelector::Count(float response, int change) {
  const int bin = BinOf(response);
  counts_[bin] += change;
  if (bin >= least_bin_) held_from_least_bin_ += change;
  while (certain_ == 0 && held_from_least_bin_ - counts_[least_bin_] >= max_features_) {
    held_from_least_bin_ -= counts_[least_bin_++];
  }
}

void GridSelector::RankCells() {
  const int cells = columns_ * rows_;
  runners_up_.clear();
  for (int cell = 0; cell < cells; ++cell) {
    Keypoint* begin = CellBegin(cell);
    std::sort(begin, begin + sizes_[cell], Stronger);
    kept_[cell] = std::min(sizes_[cell], certain_);
    for (int i = kept_[cell]; i < sizes_[cell]; ++i) runners_up_.push_back(begin + i);
  }
}

void GridSelector::Select(FeatureSet& selected) {
  RankCells();
  const int cells = columns_ * rows_;
  int left = max_features_;
  for (int cell = 0; cell < cells; ++cell) left -= kept_[cell];

  const int taken = std::min(left, static_cast<int>(runners_up_.size()));
  const auto cut = runners_up_.begin() + taken;
  std::nth_element(runners_up_.begin(), cut, runners_up_.end(),
                   [](const Keypoint* a, const Keypoint* b) { return Stronger(*a, *b); });
  // A cell's chosen runners-up follow its certain points directly, as it is sorted.
  for (auto it = runners_up_.begin(); it != cut; ++it) {
    ++kept_[(*it - keypoints_.data()) / kCellCapacity];
  }

  selected.Clear();
  for (int cell = 0; cell < cells; ++cell) {
    const Keypoint* begin = CellBegin(cell);
    for (int i = 0; i < kept_[cell]; ++i) selected.Append(begin[i]);
  }
}

}  // namespace viewfix
