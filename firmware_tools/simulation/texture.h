// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

namespace viewfix::simulation {

// A bitmap with its mip-maps (each level half the size of the one before,
// box-filtered), sides rounded to powers of two so that it repeats by masking.
class Texture {
 public:
  // `image`: 8-bit BGR or BGRA; alpha below one half is a hole.
  explicit Texture(const cv::Mat& image);

  bool has_alpha() const { return has_alpha_; }
  int width() const { return levels_[0].width; }
  int height() const { return levels_[0].height; }
  int num_levels() const { return static_cast<int>(levels_.size()); }

  // Bilinear sample packed as 0xAARRGGBB. u runs right, v down, 0..1 is the whole
  // picture; both repeat. `level` is clamped.
  std::uint32_t Sample(float u, float v, int level) const;

 private:
  struct Level {
    int width, height;
    std::vector<std::uint32_t> texels;
  };
  void AddLevel(const cv::Mat& bgra);

  std::vector<Level> levels_;
  bool has_alpha_ = false;
};

using TexturePtr = std::shared_ptr<const Texture>;

}  // namespace viewfix::simulation
