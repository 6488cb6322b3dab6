// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/orient.h"

#include <cstddef>

namespace viewfix {
namespace {

// Where upright pixel (x, y) stands in the stored pixels: first + x * dx + y * dy.
struct Walk {
  std::ptrdiff_t first = 0;
  std::ptrdiff_t dx = 0;
  std::ptrdiff_t dy = 0;
};

Walk WalkOf(int orientation, std::ptrdiff_t width, std::ptrdiff_t height) {
  const std::ptrdiff_t right = width - 1;
  const std::ptrdiff_t bottom = (height - 1) * width;
  switch (orientation) {
    case 2:
      return {right, -1, width};
    case 3:
      return {bottom + right, -1, -width};
    case 4:
      return {bottom, 1, -width};
    case 5:
      return {0, width, 1};
    case 6:
      return {bottom, -width, 1};
    case 7:
      return {bottom + right, -width, -1};
    case 8:
      return {right, width, -1};
    default:
      return {0, 1, width};
  }
}

}  // namespace

void Orient(const GreyImage& stored, int orientation, GreyImage& upright) {
  const bool on_its_side = orientation >= 5 && orientation <= 8;
  upright.width = on_its_side ? stored.height : stored.width;
  upright.height = on_its_side ? stored.width : stored.height;
  upright.pixels.resize(stored.pixels.size());
  const Walk walk = WalkOf(orientation, stored.width, stored.height);
  std::uint8_t* out = upright.pixels.data();
  for (int y = 0; y < upright.height; ++y) {
    std::ptrdiff_t from = walk.first + y * walk.dy;
    for (int x = 0; x < upright.width; ++x, from += walk.dx) *out++ = stored.pixels[from];
  }
}

}  // namespace viewfix
