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

// The samples of a row are kept in an order in which the same sample of four subregions side
// by side is one vector: sample n is number n % 5 of group n / 5, and groups of one number lie
// together. Subregion r takes numbers 0..4 of group r and 0..3 of group r + 1.
constexpr int Group(int n) { return n / kRegionStep; }
constexpr int Slot(int n) { return n % kRegionStep * (Group(kSamples - 1) + 1) + Group(n); }

// Samples from the middle of the square, by slot.
constexpr std::array<float, kSamples> MakeColumns() {
  std::array<float, kSamples> columns{};
  for (int n = 0; n < kSamples; ++n)
    columns[Slot(n)] = static_cast<float>(n) - 0.5F * (kSamples - 1);
  return columns;
}
constexpr std::array<float, kSamples> kColumns = MakeColumns();

// dx and dy of each sample, row by row.
template <typename T>
using Pairs = std::array<T, 2 * kSamples * kSamples>;

// dx and dy for each of some samples, or of some subregions side by side. By reference only, as
// processors without such vectors pass them in other ways.
#if defined(__x86_64__)
constexpr int kLanes = 8;
#else
constexpr int kLanes = 4;  // as NEON has: GCC 12 keeps vectors of two registers in memory
#endif
using Floats [[gnu::vector_size(kLanes * sizeof(float))]] = float;
using Ints [[gnu::vector_size(kLanes * sizeof(std::int32_t))]] = std::int32_t;

// Numbers of one row of subregions: dx and dy, and as many vectors.
constexpr int kRowNumbers = 2 * kRegions;
constexpr int kRowVectors = kRowNumbers / kLanes;

// Where the samples lie.
template <bool kInside>
[[gnu::always_inline]] inline void FindOffsets(const HaarSquares& squares, const Keypoint& keypoint,
                                               float cos_step, float sin_step,
                                               std::array<int, kSamples * kSamples>& offsets) {
  for (int row = 0; row < kSamples; ++row) {
    const float v = static_cast<float>(row) - 0.5F * (kSamples - 1);
    for (int slot = 0; slot < kSamples; ++slot) {
      const float x = keypoint.x + (cos_step * kColumns[slot] - sin_step * v);
      const float y = keypoint.y + (sin_step * kColumns[slot] + cos_step * v);
      offsets[row * kSamples + slot] = squares.Offset<kInside>(x, y);
    }
  }
}

[[gnu::always_inline]] inline void ReadSamples(const IntegralImage& image, const Keypoint& keypoint,
                                               Pairs<std::int32_t>& pairs) {
  const HaarSquares squares(image, std::max(1, static_cast<int>(keypoint.sigma + 0.5F)));
  const float cos_step = keypoint.cos_angle * (kSpacing * keypoint.sigma);
  const float sin_step = keypoint.sin_angle * (kSpacing * keypoint.sigma);
  const float reach = 0.5F * (kSamples - 1) * (std::fabs(cos_step) + std::fabs(sin_step));
  std::array<int, kSamples * kSamples> offsets;
  if (squares.AreInside(keypoint.x, keypoint.y, reach)) {
    FindOffsets<true>(squares, keypoint, cos_step, sin_step, offsets);
  } else {
    FindOffsets<false>(squares, keypoint, cos_step, sin_step, offsets);
  }
  for (int i = 0; i < kSamples * kSamples; ++i) {
    const HaarResponse haar = squares.At(offsets[i]);
    pairs[2 * i] = haar.dx;
    pairs[2 * i + 1] = haar.dy;
  }
}

// To the key point's own, turned axes.
[[gnu::always_inline]] inline void Turn(const Pairs<std::int32_t>& pairs, float cos_angle,
                                        float sin_angle, Pairs<float>& turned) {
  Floats sines;
  for (int i = 0; i < kLanes; ++i) sines[i] = i % 2 == 0 ? sin_angle : -sin_angle;
  for (std::size_t i = 0; i < pairs.size(); i += kLanes) {
    Ints whole;
    std::memcpy(&whole, &pairs[i], sizeof(whole));
    const Floats xy = __builtin_convertvector(whole, Floats);
#if defined(__x86_64__)
    const Floats yx = __builtin_shufflevector(xy, xy, 1, 0, 3, 2, 5, 4, 7, 6);
#else
    const Floats yx = __builtin_shufflevector(xy, xy, 1, 0, 3, 2);
#endif
    const Floats both = cos_angle * xy + sines * yx;
    std::memcpy(&turned[i], &both, sizeof(both));
  }
}

// Of the subregions of one row.
struct RegionSums {
  Floats plain[kRowVectors] = {};
  Floats absolute[kRowVectors] = {};

  float Plain(int i) const { return plain[i / kLanes][i % kLanes]; }
  float Absolute(int i) const { return absolute[i / kLanes][i % kLanes]; }
};

[[gnu::always_inline]] inline void AddSample(const float* sample, float weight, RegionSums& sums) {
  for (int v = 0; v < kRowVectors; ++v) {
    Floats weighed;
    std::memcpy(&weighed, sample + v * kLanes, sizeof(weighed));
    weighed *= weight;
    sums.plain[v] += weighed;
    sums.absolute[v] += reinterpret_cast<Floats>(reinterpret_cast<Ints>(weighed) & 0x7fffffff);
  }
}

// Sample after sample, all subregions at once.
[[gnu::always_inline]] inline void SumRegions(const Pairs<float>& samples,
                                              std::array<RegionSums, kRegions>& sums) {
  for (int row = 0; row < kRegionSide; ++row) {
    for (int column = 0; column < kRegionSide; ++column) {
      const float* const sample = &samples[2 * (row * kSamples + Slot(column))];
      const float weight = kSampleWeights[row][column];
      for (int i = 0; i < kRegions; ++i) {
        AddSample(sample + 2 * i * kRegionStep * kSamples, weight, sums[i]);
      }
    }
  }
}

// Rounds to nearest, halves away from zero, and clips to -127..127.
std::int8_t Quantize(float value) {
  const float rounded = value + (value < 0 ? -0.5F : 0.5F);
  return static_cast<std::int8_t>(std::clamp(static_cast<int>(rounded), -127, 127));
}

struct DescriptorKernel {
  VIEWFIX_KERNEL void Run(const IntegralImage* image, const Keypoint* keypoint,
                          std::int8_t* descriptor) {
    Pairs<std::int32_t> pairs;
    ReadSamples(*image, *keypoint, pairs);
    Pairs<float> turned;
    Turn(pairs, keypoint->cos_angle, keypoint->sin_angle, turned);
    std::array<RegionSums, kRegions> sums;
    SumRegions(turned, sums);
    std::array<float, kSurfDim> values;
    for (int row = 0; row < kRegions; ++row) {
      for (int column = 0; column < kRegions; ++column) {
        const float weight = kRegionWeights[row][column];
        float* const region = &values[(row * kRegions + column) * 4];
        region[0] = sums[row].Plain(2 * column) * weight;
        region[1] = sums[row].Plain(2 * column + 1) * weight;
        region[2] = sums[row].Absolute(2 * column) * weight;
        region[3] = sums[row].Absolute(2 * column + 1) * weight;
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
  // The corners are read one by one, and put into longer vectors at a loss.
  RunOnPath<DescriptorKernel>(std::min(path, CpuPath::kAvx2), &image, &keypoint, descriptor.data());
}

}  // namespace viewfix
