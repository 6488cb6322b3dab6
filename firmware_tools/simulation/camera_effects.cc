// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/simulation/camera_effects.h"

#include <array>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace viewfix::simulation {
namespace {

float Draw(Random& random, double low, double high) {
  return static_cast<float>(random.Uniform(low, high));
}

// A line of the motion's length and direction, in a kernel that sums to 1.
cv::Mat MotionKernel(float length, float angle) {
  const int radius = static_cast<int>(std::ceil(length / 2)) + 1;
  cv::Mat kernel = cv::Mat::zeros(2 * radius + 1, 2 * radius + 1, CV_32F);
  constexpr int kSteps = 64;
  for (int i = 0; i < kSteps; ++i) {
    const float t = (static_cast<float>(i) / (kSteps - 1) - 0.5f) * length;
    const float x = static_cast<float>(radius) + t * std::cos(angle);
    const float y = static_cast<float>(radius) + t * std::sin(angle);
    const int left = static_cast<int>(x);
    const int top = static_cast<int>(y);
    const float u = x - static_cast<float>(left);
    const float v = y - static_cast<float>(top);
    kernel.at<float>(top, left) += (1 - u) * (1 - v);
    kernel.at<float>(top, left + 1) += u * (1 - v);
    kernel.at<float>(top + 1, left) += (1 - u) * v;
    kernel.at<float>(top + 1, left + 1) += u * v;
  }
  return kernel / kSteps;
}

// sRGB-like curve by table: linear 0..1 to grey levels.
float ToneCurve(float linear) {
  static const auto kTable = [] {
    std::array<float, 4097> table{};
    for (int i = 0; i <= 4096; ++i)
      table[i] = 255 * std::pow(static_cast<float>(i) / 4096, 1 / 2.2f);
    return table;
  }();
  return kTable[static_cast<int>(std::min(std::max(linear, 0.0f), 1.0f) * 4096)];
}

// Approximately normal: the sum of four 16-bit uniforms of one draw.
float Noise(Random& random) {
  const std::uint64_t bits = random.Next();
  const auto sum = static_cast<float>((bits & 0xffff) + (bits >> 16 & 0xffff) +
                                      (bits >> 32 & 0xffff) + (bits >> 48));
  return (sum / 65535.0f - 2.0f) * 1.732f;
}

}  // namespace

Exposure DrawExposure(Random& random, bool is_test) {
  Exposure e;
  e.illumination.skylight = is_test ? Draw(random, 0.25, 0.9) : Draw(random, 0.5, 0.62);
  e.illumination.lamps = is_test ? Draw(random, 0.5, 1.1) : Draw(random, 0.92, 1.05);
  e.gain = is_test ? Draw(random, 0.5, 1.5) : Draw(random, 0.88, 1.12);
  const double tint = is_test ? 0.2 : 0.04;
  for (int c = 0; c < 3; ++c) e.white_balance[c] = 1 + Draw(random, -tint, tint);
  e.vignetting = Draw(random, 0.15, 0.35);
  e.noise = is_test ? Draw(random, 2, 6) : Draw(random, 1, 4);
  if (random.Chance(0.25)) e.blur_length = Draw(random, 2, 10);
  e.blur_angle = Draw(random, 0, std::numbers::pi);
  e.jpeg_quality = 80 + random.Below(13);
  return e;
}

std::vector<std::uint8_t> Develop(const cv::Mat& linear, const Exposure& exposure, Random& random) {
  cv::Mat light = linear;
  if (exposure.blur_length > 0) {
    cv::filter2D(linear, light, -1, MotionKernel(exposure.blur_length, exposure.blur_angle),
                 {-1, -1}, 0, cv::BORDER_REFLECT);
  }
  const cv::Vec3f factors = exposure.white_balance * exposure.gain;
  const float cx = static_cast<float>(light.cols - 1) / 2;
  const float cy = static_cast<float>(light.rows - 1) / 2;
  cv::Mat developed(light.size(), CV_8UC3);
  for (int y = 0; y < light.rows; ++y) {
    for (int x = 0; x < light.cols; ++x) {
      const float dx = static_cast<float>(x) - cx;
      const float dy = static_cast<float>(y) - cy;
      const float lens = 1 - exposure.vignetting * (dx * dx + dy * dy) / (cx * cx + cy * cy);
      const float noise = exposure.noise * Noise(random);
      const auto& in = light.at<cv::Vec3f>(y, x);
      auto& out = developed.at<cv::Vec3b>(y, x);
      for (int c = 0; c < 3; ++c) {
        out[c] = cv::saturate_cast<std::uint8_t>(ToneCurve(in[c] * factors[c] * lens) + noise);
      }
    }
  }
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", developed, bytes, {cv::IMWRITE_JPEG_QUALITY, exposure.jpeg_quality});
  return bytes;
}

}  // namespace viewfix::simulation
