// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

namespace viewfix {

// A colour picture, row by row, red green blue.
struct RgbImage {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> pixels;  // [height, width, 3]
};

// A picture as a JPEG, for people to look at. Empty: libjpeg refuses the size.
std::vector<std::uint8_t> EncodeJpeg(const RgbImage& image, int quality);

}  // namespace viewfix
