// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>

#include "engine/image/image_view.h"

namespace viewfix {

// Whether a picture still shows what the reference shows, for a few thousand additions: the means
// of 32 x 24 cells, of 16 pixels each, are compared. The noise of a camera moves such a mean by
// 1 or 2 grey levels; what a person in view or a turn of the camera moves is whole cells by tens.
class SceneChange {
 public:
  // Becomes what is compared with.
  void SetReference(const ImageView& image);
  // Also true without a reference, or if it had another size.
  bool Differs(const ImageView& image) const;

 private:
  static constexpr int kColumns = 32;
  static constexpr int kRows = 24;
  static constexpr int kSamples = 16;  // of a cell
  using Cells = std::array<std::int16_t, std::size_t{kColumns} * kRows>;

  static Cells CellsOf(const ImageView& image);

  int width_ = 0;
  int height_ = 0;
  Cells reference_ = {};
};

}  // namespace viewfix
