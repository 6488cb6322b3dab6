// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/image/image_view.h"

namespace viewfix {

// Pixels that own themselves, with `extra` unused bytes at the end of each row.
struct TestImage {
  TestImage(int image_width, int image_height, int extra = 0)
      : width(image_width),
        height(image_height),
        row_bytes(image_width + extra),
        pixels(std::size_t(row_bytes) * image_height) {}

  std::uint8_t& At(int x, int y) { return pixels[std::size_t(y) * row_bytes + x]; }
  int At(int x, int y) const { return pixels[std::size_t(y) * row_bytes + x]; }
  ImageView View() const { return {pixels.data(), width, height, row_bytes}; }

  int width;
  int height;
  int row_bytes;
  std::vector<std::uint8_t> pixels;
};

// The same bytes on every machine, unlike the distributions of <random>.
class TestRandom {
 public:
  explicit TestRandom(std::uint64_t seed) : state_(seed * 2 + 1) {}
  // 0..bound-1.
  int Below(int bound) {
    state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL;
    return static_cast<int>((state_ >> 33) % static_cast<std::uint64_t>(bound));
  }

 private:
  std::uint64_t state_;
};

inline TestImage NoiseImage(int width, int height, std::uint64_t seed, int extra = 0) {
  TestImage image(width, height, extra);
  TestRandom random(seed);
  for (std::uint8_t& pixel : image.pixels) pixel = static_cast<std::uint8_t>(random.Below(256));
  return image;
}

// Overlapping bars of many sizes and grey values: edges, corners and blobs.
inline TestImage BarsImage(int width, int height, std::uint64_t seed, int extra = 0) {
  TestImage image(width, height, extra);
  TestRandom random(seed);
  const int bars = width * height / 400;
  for (int bar = 0; bar < bars; ++bar) {
    const int largest = 60 - 55 * bar / bars;
    const int x0 = random.Below(width);
    const int y0 = random.Below(height);
    const int x1 = x0 + 2 + random.Below(largest);
    const int y1 = y0 + 2 + random.Below(largest);
    const auto grey = static_cast<std::uint8_t>(random.Below(256));
    for (int y = y0; y < y1 && y < height; ++y) {
      for (int x = x0; x < x1 && x < width; ++x) image.At(x, y) = grey;
    }
  }
  return image;
}

}  // namespace viewfix
