// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/simulation/texture.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <opencv2/imgproc.hpp>

namespace viewfix::simulation {
namespace {

int PowerOfTwo(int side) {
  const int above = static_cast<int>(std::bit_ceil(static_cast<unsigned>(side)));
  return above - side > side / 4 ? above / 2 : above;
}

// a + (b - a) * weight / 256 on all four bytes at once.
std::uint32_t Mix(std::uint32_t a, std::uint32_t b, std::uint32_t weight) {
  constexpr std::uint32_t kEven = 0x00ff00ff;
  const std::uint32_t even = ((a & kEven) * (256 - weight) + (b & kEven) * weight) >> 8;
  const std::uint32_t odd = ((a >> 8) & kEven) * (256 - weight) + ((b >> 8) & kEven) * weight;
  return (even & kEven) | (odd & ~kEven);
}

}  // namespace

Texture::Texture(const cv::Mat& image) {
  has_alpha_ = image.channels() == 4;
  cv::Mat level;
  if (has_alpha_) {
    level = image;
  } else {
    cv::cvtColor(image, level, cv::COLOR_BGR2BGRA);
  }
  cv::resize(level, level, {PowerOfTwo(level.cols), PowerOfTwo(level.rows)}, 0, 0,
             cv::INTER_LINEAR);
  AddLevel(level);
  while (level.cols > 1 || level.rows > 1) {
    cv::resize(level, level, {std::max(1, level.cols / 2), std::max(1, level.rows / 2)}, 0, 0,
               cv::INTER_AREA);
    AddLevel(level);
  }
}

void Texture::AddLevel(const cv::Mat& bgra) {
  Level level{bgra.cols, bgra.rows, {}};
  level.texels.resize(bgra.total());
  std::memcpy(level.texels.data(), bgra.data, bgra.total() * 4);
  levels_.push_back(std::move(level));
}

std::uint32_t Texture::Sample(float u, float v, int level_idx) const {
  const Level& level = levels_[std::clamp(level_idx, 0, num_levels() - 1)];
  const float x = u * static_cast<float>(level.width) - 0.5f;
  const float y = v * static_cast<float>(level.height) - 0.5f;
  const float x_floor = std::floor(x), y_floor = std::floor(y);
  const int x0 = static_cast<int>(x_floor) & (level.width - 1), x1 = (x0 + 1) & (level.width - 1);
  const int y0 = static_cast<int>(y_floor) & (level.height - 1), y1 = (y0 + 1) & (level.height - 1);
  const auto weight_x = static_cast<std::uint32_t>((x - x_floor) * 256.f);
  const auto weight_y = static_cast<std::uint32_t>((y - y_floor) * 256.f);
  const std::uint32_t* row0 = level.texels.data() + static_cast<std::size_t>(y0) * level.width;
  const std::uint32_t* row1 = level.texels.data() + static_cast<std::size_t>(y1) * level.width;
  return Mix(Mix(row0[x0], row0[x1], weight_x), Mix(row1[x0], row1[x1], weight_x), weight_y);
}

}  // namespace viewfix::simulation
