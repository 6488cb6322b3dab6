// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "engine/base/cpu_path.h"
#include "engine/image/image_view.h"

namespace viewfix {

struct ImageSize {
  int width = 0;   // pixels
  int height = 0;  // pixels
};

// The size of a width x height image whose longest side is shrunk to max_side:
// the other side is rounded, and at least 1. Unchanged where it fits already.
ImageSize ShrunkSize(int width, int height, int max_side);

// Shrinks images to a longest side by averaging over areas: each target pixel is
// the mean of the source rectangle that it covers, where partly covered pixels
// count by their share, rounded half up. Whole numbers throughout: the same bytes
// on every processor.
//
// Source w x h, target w' x h' = ShrunkSize(): the target pixel with centre x'
// shows the source point x = (x' + 0.5) * w / w' - 0.5; y with h / h' likewise.
//
// Memory is allocated by the constructor alone. One instance serves one thread.
class Shrinker {
 public:
  // max_side in 1..kMaxImageSide.
  explicit Shrinker(int max_side, CpuPath path = BestCpuPath());

  // The shrunk image, living until the next call, or `image` itself where it is
  // small enough; its chroma as it is. Both sides of `image` in 1..kMaxImageSide.
  ImageView ShrinkToSide(const ImageView& image);

  int max_side() const { return max_side_; }

 private:
  void AverageAreas(const ImageView& image, ImageSize target);
  void SumRows(const ImageView& image, int target_y, int target_height);
  void AverageColumns(const ImageView& image, ImageSize target, std::uint8_t* row) const;

  int max_side_;
  CpuPath path_;
  std::vector<std::uint32_t> column_sums_;  // of one target row, at the source's width
  std::vector<std::uint8_t> pixels_;
};

}  // namespace viewfix
