// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/orient.h"

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

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

bool OnItsSide(int orientation) { return orientation >= 5 && orientation <= 8; }

//   width, height  of the stored plane
void OrientPlane(const std::vector<std::uint8_t>& stored, int width, int height, int orientation,
                 std::vector<std::uint8_t>& upright) {
  upright.resize(stored.size());
  if (stored.empty()) return;
  const Walk walk = WalkOf(orientation, width, height);
  if (OnItsSide(orientation)) std::swap(width, height);
  std::uint8_t* out = upright.data();
  for (int y = 0; y < height; ++y) {
    std::ptrdiff_t from = walk.first + y * walk.dy;
    for (int x = 0; x < width; ++x, from += walk.dx) *out++ = stored[from];
  }
}

}  // namespace

void Orient(const YuvImage& stored, int orientation, YuvImage& upright) {
  upright.luma_only = stored.luma_only;
  upright.width = OnItsSide(orientation) ? stored.height : stored.width;
  upright.height = OnItsSide(orientation) ? stored.width : stored.height;
  OrientPlane(stored.pixels, stored.width, stored.height, orientation, upright.pixels);
  OrientPlane(stored.cb, stored.ChromaWidth(), stored.ChromaHeight(), orientation, upright.cb);
  OrientPlane(stored.cr, stored.ChromaWidth(), stored.ChromaHeight(), orientation, upright.cr);
}

}  // namespace viewfix
