// SPDX-License-Identifier: BSD-3-Clause
#include "engine/features/surf_descriptor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>

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

// Samples are kept in an order in which the same sample of four subregions side by side is
// one vector: sample n of a row or column is number n % 5 of group n / 5, and groups of one
// number lie together. Subregion r takes numbers 0..4 of group r and 0..3 of group r + 1.
constexpr int kGroups = 5;
constexpr int kRowStride = kRegionStep * kGroups;                   // slots of one row
constexpr int kSlots = kRowStride * kRowStride;                     // some stay empty
constexpr int kPaddedSlots = (kSlots + 15) / 16 * 16;               // whole vectors
constexpr int Slot(int n) { return n % kRegionStep * kGroups + n / kRegionStep; }

// Gradient samples in the key point's own, turned axes.
struct Samples {
  std::array<float, kPaddedSlots> dx;
  std::array<float, kPaddedSlots> dy;
};

// Where the samples of one row lie.
[[gnu::always_inline]] inline void FindMiddles(const HaarSquares& squares,
                                               const Keypoint& keypoint, float cos_step,
                                               float sin_step, int row,
                                               std::array<int, kSamples>& offsets) {
  const float v = static_cast<float>(row) - 0.5F * (kSamples - 1);
  for (int column = 0; column < kSamples; ++column) {
    const float u = static_cast<float>(column) - 0.5F * (kSamples - 1);
    const float x = keypoint.x + (cos_step * u - sin_step * v);
    const float y = keypoint.y + (sin_step * u + cos_step * v);
    offsets[column] = squares.Offset(squares.MiddleX(x), squares.MiddleY(y));
  }
}

[[gnu::always_inline]] inline void Sample(const IntegralImage& image, const Keypoint& keypoint,
                                          Samples& samples) {
  const HaarSquares squares(image, std::max(1, static_cast<int>(keypoint.sigma + 0.5F)));
  const float cos_step = keypoint.cos_angle * (kSpacing * keypoint.sigma);
  const float sin_step = keypoint.sin_angle * (kSpacing * keypoint.sigma);
  std::array<std::int32_t, kPaddedSlots> dx{};
  std::array<std::int32_t, kPaddedSlots> dy{};
  for (int row = 0; row < kSamples; ++row) {
    std::array<int, kSamples> offsets;
    FindMiddles(squares, keypoint, cos_step, sin_step, row, offsets);
    const int row_slot = Slot(row) * kRowStride;
    for (int column = 0; column < kSamples; ++column) {
      const HaarResponse haar = squares.At(offsets[column]);
      dx[row_slot + Slot(column)] = haar.dx;
      dy[row_slot + Slot(column)] = haar.dy;
    }
  }
  for (int i = 0; i < kPaddedSlots; ++i) {
    const auto x = static_cast<float>(dx[i]);
    const auto y = static_cast<float>(dy[i]);
    samples.dx[i] = keypoint.cos_angle * x + keypoint.sin_angle * y;
    samples.dy[i] = keypoint.cos_angle * y - keypoint.sin_angle * x;
  }
}

// One value for each of four subregions side by side.
using Four [[gnu::vector_size(4 * sizeof(float))]] = float;
using FourBits [[gnu::vector_size(4 * sizeof(std::int32_t))]] = std::int32_t;

[[gnu::always_inline]] inline Four Load(const float* values) {
  Four four;
  std::memcpy(&four, values, sizeof(four));
  return four;
}

[[gnu::always_inline]] inline Four Abs(Four values) {
  return reinterpret_cast<Four>(reinterpret_cast<FourBits>(values) & 0x7fffffff);
}

// (sum dx, sum dy, sum |dx|, sum |dy|) of the subregions of one row, sample after sample.
[[gnu::always_inline]] inline std::array<Four, 4> SumRegions(const Samples& samples,
                                                             int region_row) {
  std::array<Four, 4> sums{};
  for (int row = 0; row < kRegionSide; ++row) {
    const int row_slot = Slot(region_row * kRegionStep + row) * kRowStride;
    for (int column = 0; column < kRegionSide; ++column) {
      const float weight = kSampleWeights[row][column];
      const int slot = row_slot + Slot(column);
      const Four dx = weight * Load(&samples.dx[slot]);
      const Four dy = weight * Load(&samples.dy[slot]);
      sums[0] += dx;
      sums[1] += dy;
      sums[2] += Abs(dx);
      sums[3] += Abs(dy);
    }
  }
  return sums;
}

// Rounds to nearest, halves away from zero, and clips to -127..127.
std::int8_t Quantize(float value) {
  const float rounded = value < 0 ? value - 0.5F : value + 0.5F;
  return static_cast<std::int8_t>(std::clamp(static_cast<int>(rounded), -127, 127));
}

struct DescriptorKernel {
  VIEWFIX_KERNEL void Run(const IntegralImage* image, const Keypoint* keypoint,
                          std::int8_t* descriptor) {
    Samples samples;
    Sample(*image, *keypoint, samples);
    std::array<float, kSurfDim> values;
    for (int row = 0; row < kRegions; ++row) {
      const std::array<Four, 4> sums = SumRegions(samples, row);
      for (int column = 0; column < kRegions; ++column) {
        const float weight = kRegionWeights[row][column];
        for (int i = 0; i < 4; ++i) {
          values[(row * kRegions + column) * 4 + i] = sums[i][column] * weight;
        }
      }
    }
    float length2 = 0;
    for (const float value : values) length2 += value * value;
    const float scale = length2 > 0 ? kLength / std::sqrt(length2) : 0;
    for (int i = 0; i < kSurfDim; ++i) descriptor[i] = Quantize(values[i] * scale);
  }
};

}  // namespace

void DescribeSurf(const IntegralImage& image, const Keypoint& keypoint,
                  std::span<std::int8_t, kSurfDim> descriptor, CpuPath path) {
  RunOnPath<DescriptorKernel>(path, &image, &keypoint, descriptor.data());
}

}  // namespace viewfix
