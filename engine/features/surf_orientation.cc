// SPDX-License-Identifier: BSD-3-Clause
#include "engine/features/surf_orientation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "engine/features/gaussian.h"
#include "engine/features/haar.h"

namespace viewfix {
namespace {

constexpr int kRadius = 6;
constexpr int kSide = 2 * kRadius + 1;
constexpr double kWeightSigma = 2.5;
constexpr int kSectors = 72;  // of 5 degrees
constexpr int kSectorsPerOctant = kSectors / 8;
constexpr int kWindow = kSectors / 6;  // 60 degrees

// The places within the radius, row by row, with their weights; places of no weight after them.
constexpr int kPlaces = 113;
constexpr int kPaddedPlaces = 120;  // whole vectors
struct Disc {
  std::array<float, kPaddedPlaces> x{};  // sigma from the key point
  std::array<float, kPaddedPlaces> y{};
  std::array<float, kPaddedPlaces> weights{};
};

constexpr Disc MakeDisc() {
  Disc disc;
  int i = 0;
  for (int row = 0; row < kSide; ++row) {
    for (int column = 0; column < kSide; ++column) {
      const int r2 = (row - kRadius) * (row - kRadius) + (column - kRadius) * (column - kRadius);
      if (r2 > kRadius * kRadius) continue;
      disc.x[i] = static_cast<float>(column - kRadius);
      disc.y[i] = static_cast<float>(row - kRadius);
      disc.weights[i++] = Gaussian(r2, kWeightSigma);
    }
  }
  return disc;
}
constexpr Disc kDisc = MakeDisc();

// tan(5 deg), tan(10 deg) ... tan(40 deg).
constexpr std::array<float, kSectorsPerOctant - 1> kTangents = {
    0.087488664F, 0.176326981F, 0.267949192F, 0.363970234F,
    0.466307658F, 0.577350269F, 0.700207538F, 0.839099631F};

// Which of the 72 sectors of 5 degrees holds the direction (x, y), counted from the x
// axis towards y: within the octant by comparing with tangents.
[[gnu::always_inline]] inline int Sector(float x, float y) {
  const float ax = std::fabs(x);
  const float ay = std::fabs(y);
  const bool steep = ay > ax;
  const float run = steep ? ay : ax;
  const float rise = steep ? ax : ay;
  int sector = 0;
  for (const float tangent : kTangents) sector += rise > tangent * run ? 1 : 0;
  sector = steep ? kSectors / 4 - 1 - sector : sector;
  sector = x < 0 ? kSectors / 2 - 1 - sector : sector;
  return y < 0 ? kSectors - 1 - sector : sector;
}

// Weighted responses at the places of the disc.
struct Gradients {
  std::array<float, kPaddedPlaces> dx;
  std::array<float, kPaddedPlaces> dy;
};

// Sums by sector, the first ones once more after the last, so that windows need not wrap.
struct SectorSums {
  std::array<float, kSectors + kWindow> x{};
  std::array<float, kSectors + kWindow> y{};
};

template <bool kInside>
[[gnu::always_inline]] inline void FindOffsets(const HaarSquares& squares, const Keypoint& keypoint,
                                               std::array<int, kPaddedPlaces>& offsets) {
  for (int i = 0; i < kPaddedPlaces; ++i) {
    offsets[i] = squares.Offset<kInside>(keypoint.x + kDisc.x[i] * keypoint.sigma,
                                         keypoint.y + kDisc.y[i] * keypoint.sigma);
  }
}

[[gnu::always_inline]] inline void Weigh(const IntegralImage& image, const Keypoint& keypoint,
                                         Gradients& gradients) {
  const HaarSquares squares(image, std::max(1, static_cast<int>(2 * keypoint.sigma + 0.5F)));
  std::array<int, kPaddedPlaces> offsets;
  if (squares.AreInside(keypoint.x, keypoint.y, kRadius * keypoint.sigma)) {
    FindOffsets<true>(squares, keypoint, offsets);
  } else {
    FindOffsets<false>(squares, keypoint, offsets);
  }
  std::array<std::int32_t, kPaddedPlaces> dx;
  std::array<std::int32_t, kPaddedPlaces> dy;
  for (int i = 0; i < kPaddedPlaces; ++i) {
    const HaarResponse haar = squares.At(offsets[i]);
    dx[i] = haar.dx;
    dy[i] = haar.dy;
  }
  for (int i = 0; i < kPaddedPlaces; ++i) {
    gradients.dx[i] = kDisc.weights[i] * static_cast<float>(dx[i]);
    gradients.dy[i] = kDisc.weights[i] * static_cast<float>(dy[i]);
  }
}

[[gnu::always_inline]] inline void SumBySector(const Gradients& gradients, SectorSums& sums) {
  std::array<int, kPaddedPlaces> sectors;
  for (int i = 0; i < kPaddedPlaces; ++i) {
    sectors[i] = Sector(gradients.dx[i], gradients.dy[i]);
  }
  for (int i = 0; i < kPlaces; ++i) {
    sums.x[sectors[i]] += gradients.dx[i];
    sums.y[sectors[i]] += gradients.dy[i];
  }
  std::copy_n(sums.x.begin(), kWindow, sums.x.begin() + kSectors);
  std::copy_n(sums.y.begin(), kWindow, sums.y.begin() + kSectors);
}

struct OrientationKernel {
  VIEWFIX_KERNEL void Run(const IntegralImage* image, Keypoint* keypoint) {
    Gradients gradients;
    Weigh(*image, *keypoint, gradients);
    SectorSums sums;
    SumBySector(gradients, sums);
    // All windows side by side, each summed from its first sector on.
    std::array<float, kSectors> x{};
    std::array<float, kSectors> y{};
    for (int i = 0; i < kWindow; ++i) {
      for (int first = 0; first < kSectors; ++first) x[first] += sums.x[first + i];
      for (int first = 0; first < kSectors; ++first) y[first] += sums.y[first + i];
    }
    std::array<float, kSectors> length2;
    for (int i = 0; i < kSectors; ++i) length2[i] = x[i] * x[i] + y[i] * y[i];
    int best = 0;
    for (int i = 1; i < kSectors; ++i) best = length2[i] > length2[best] ? i : best;
    const float length = std::sqrt(length2[best]);
    keypoint->cos_angle = length > 0 ? x[best] / length : 1;
    keypoint->sin_angle = length > 0 ? y[best] / length : 0;
  }
};

}  // namespace

void AssignOrientation(const IntegralImage& image, Keypoint& keypoint, CpuPath path) {
  // The corners are read one by one, and put into longer vectors at a loss.
  RunOnPath<OrientationKernel>(std::min(path, CpuPath::kAvx2), &image, &keypoint);
}

}  // namespace viewfix
