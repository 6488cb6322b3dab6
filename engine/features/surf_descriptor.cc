// SPDX-License-Identifier: BSD-3-Clause
#include "engine/features/surf_descriptor.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/features/gaussian.h"
#include "engine/features/haar.h"

namespace viewfix {
namespace {

constexpr int kSamples = 24;          // across the whole square
constexpr int kRegions = 4;           // across
constexpr int kRegionStep = 5;        // samples
constexpr int kRegionSide = 9;        // samples
constexpr double kSampleSigma = 2.5;  // samples
constexpr double kRegionSigma = 1.5;  // regions
constexpr float kSpacing = 0.7F;      // sigma between samples
constexpr float kLength = 127;

template <int N>
using Table = std::array<std::array<float, N>, N>;

template <int N>
constexpr Table<N> MakeGaussian(double sigma) {
  Table<N> table{};
  for (int row = 0; row < N; ++row) {
    for (int column = 0; column < N; ++column) {
      const double y = row - (N - 1) / 2.0;
      const double x = column - (N - 1) / 2.0;
      table[row][column] = Gaussian(x * x + y * y, sigma);
    }
  }
  return table;
}

constexpr Table<kRegionSide> kSampleWeights = MakeGaussian<kRegionSide>(kSampleSigma);
constexpr Table<kRegions> kRegionWeights = MakeGaussian<kRegions>(kRegionSigma);

// Gradient samples in the key point's own, turned axes.
struct Samples {
  Table<kSamples> dx;
  Table<kSamples> dy;
};

void Sample(const IntegralImage& image, const Keypoint& keypoint, Samples& samples) {
  const int half = std::max(1, static_cast<int>(keypoint.sigma + 0.5F));
  const float cos_step = keypoint.cos_angle * (kSpacing * keypoint.sigma);
  const float sin_step = keypoint.sin_angle * (kSpacing * keypoint.sigma);
  for (int row = 0; row < kSamples; ++row) {
    const float v = static_cast<float>(row) - 0.5F * (kSamples - 1);
    for (int column = 0; column < kSamples; ++column) {
      const float u = static_cast<float>(column) - 0.5F * (kSamples - 1);
      const float x = keypoint.x + (cos_step * u - sin_step * v);
      const float y = keypoint.y + (sin_step * u + cos_step * v);
      const HaarResponse haar = Haar(image, x, y, half);
      const auto dx = static_cast<float>(haar.dx);
      const auto dy = static_cast<float>(haar.dy);
      samples.dx[row][column] = keypoint.cos_angle * dx + keypoint.sin_angle * dy;
      samples.dy[row][column] = keypoint.cos_angle * dy - keypoint.sin_angle * dx;
    }
  }
}

// (sum dx, sum dy, sum |dx|, sum |dy|) of one subregion.
std::array<float, 4> SumRegion(const Samples& samples, int region_row, int region_column) {
  std::array<float, 4> sums{};
  for (int row = 0; row < kRegionSide; ++row) {
    const auto& dx_row = samples.dx[region_row * kRegionStep + row];
    const auto& dy_row = samples.dy[region_row * kRegionStep + row];
    for (int column = 0; column < kRegionSide; ++column) {
      const float weight = kSampleWeights[row][column];
      const float dx = weight * dx_row[region_column * kRegionStep + column];
      const float dy = weight * dy_row[region_column * kRegionStep + column];
      sums[0] += dx;
      sums[1] += dy;
      sums[2] += std::fabs(dx);
      sums[3] += std::fabs(dy);
    }
  }
  for (float& sum : sums) sum *= kRegionWeights[region_row][region_column];
  return sums;
}

// Rounds to nearest, halves away from zero, and clips to -127..127.
std::int8_t Quantize(float value) {
  const float rounded = value < 0 ? value - 0.5F : value + 0.5F;
  return static_cast<std::int8_t>(std::clamp(static_cast<int>(rounded), -127, 127));
}

}  // namespace

void DescribeSurf(const IntegralImage& image, const Keypoint& keypoint,
                  std::span<std::int8_t, kSurfDim> descriptor) {
  Samples samples;
  Sample(image, keypoint, samples);
  std::array<float, kSurfDim> values;
  float length2 = 0;
  for (int region = 0; region < kRegions * kRegions; ++region) {
    const auto sums = SumRegion(samples, region / kRegions, region % kRegions);
    for (int i = 0; i < 4; ++i) {
      values[region * 4 + i] = sums[i];
      length2 += sums[i] * sums[i];
    }
  }
  const float scale = length2 > 0 ? kLength / std::sqrt(length2) : 0;
  for (int i = 0; i < kSurfDim; ++i) descriptor[i] = Quantize(values[i] * scale);
}

}  // namespace viewfix
