// SPDX-License-Identifier: BSD-3-Clause
#include "platform/publish/draw_features.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace viewfix {
namespace {

using Colour = std::array<std::uint8_t, 3>;

constexpr Colour kMatched = {40, 230, 90};
constexpr Colour kUnmatched = {235, 170, 40};
constexpr float kMinRadiusPx = 2;
constexpr float kMaxRadiusPx = 200;

void Set(RgbImage& image, int x, int y, const Colour& colour) {
  if (x < 0 || y < 0 || x >= image.width || y >= image.height) return;
  std::uint8_t* pixel = image.pixels.data() + 3 * (std::size_t(y) * image.width + x);
  std::copy(colour.begin(), colour.end(), pixel);
}

// Of one pixel's width: the pixels whose distance from the centre is nearest to the radius.
void DrawCircle(RgbImage& image, float x, float y, float radius, const Colour& colour) {
  const int steps = static_cast<int>(std::ceil(radius * 6.3F));
  for (int i = 0; i < steps; ++i) {
    const float angle = 6.2831853F * static_cast<float>(i) / static_cast<float>(steps);
    Set(image, static_cast<int>(std::lround(x + radius * std::cos(angle))),
        static_cast<int>(std::lround(y + radius * std::sin(angle))), colour);
  }
}

}  // namespace

RgbImage DrawFeatures(const YuvImage& frame, std::span<const SeenPoint> points) {
  RgbImage image = {frame.width, frame.height, {}};
  image.pixels.reserve(3 * frame.pixels.size());
  for (const std::uint8_t grey : frame.pixels) image.pixels.insert(image.pixels.end(), 3, grey);
  for (const bool matched : {false, true}) {  // what matters lies on top
    for (const SeenPoint& point : points) {
      const bool drawn = point.matched == matched && point.radius_px > 0 &&
                         point.radius_px <= kMaxRadiusPx && point.x >= 0 && point.y >= 0 &&
                         point.x < static_cast<float>(frame.width) &&
                         point.y < static_cast<float>(frame.height);
      if (!drawn) continue;
      const float radius = std::max(point.radius_px, kMinRadiusPx);
      DrawCircle(image, point.x, point.y, radius, matched ? kMatched : kUnmatched);
      if (matched) DrawCircle(image, point.x, point.y, radius + 1, kMatched);
    }
  }
  return image;
}

}  // namespace viewfix
