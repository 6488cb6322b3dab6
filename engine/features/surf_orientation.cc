// SPDX-License-Identifier: BSD-3-Clause
#include "engine/features/surf_orientation.h"

#include <algorithm>
#include <array>
#include <cmath>

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

using WeightTable = std::array<std::array<float, kSide>, kSide>;

constexpr WeightTable MakeWeights() {
  WeightTable weights{};
  for (int row = 0; row < kSide; ++row) {
    for (int column = 0; column < kSide; ++column) {
      const int r2 = (row - kRadius) * (row - kRadius) + (column - kRadius) * (column - kRadius);
      weights[row][column] = r2 <= kRadius * kRadius ? Gaussian(r2, kWeightSigma) : 0.0F;
    }
  }
  return weights;
}
constexpr WeightTable kWeights = MakeWeights();

// tan(5 deg), tan(10 deg) ... tan(40 deg).
constexpr std::array<float, kSectorsPerOctant - 1> kTangents = {
    0.087488664F, 0.176326981F, 0.267949192F, 0.363970234F,
    0.466307658F, 0.577350269F, 0.700207538F, 0.839099631F};

// Which of the 72 sectors of 5 degrees holds the direction (x, y), counted from the x
// axis towards y: within the octant by comparing with tangents.
int Sector(float x, float y) {
  const float ax = std::fabs(x);
  const float ay = std::fabs(y);
  const bool steep = ay > ax;
  const float run = steep ? ay : ax;
  const float rise = steep ? ax : ay;
  int sector = 0;
  for (const float tangent : kTangents) sector += rise > tangent * run ? 1 : 0;
  if (steep) sector = kSectors / 4 - 1 - sector;
  if (x < 0) sector = kSectors / 2 - 1 - sector;
  if (y < 0) sector = kSectors - 1 - sector;
  return sector;
}

struct Vector {
  float x = 0;
  float y = 0;
};

using SectorSums = std::array<Vector, kSectors>;

SectorSums SumBySector(const IntegralImage& image, const Keypoint& keypoint) {
  SectorSums sums;
  const int half = std::max(1, static_cast<int>(2 * keypoint.sigma + 0.5F));
  for (int row = 0; row < kSide; ++row) {
    const float y = keypoint.y + static_cast<float>(row - kRadius) * keypoint.sigma;
    for (int column = 0; column < kSide; ++column) {
      const float weight = kWeights[row][column];
      if (weight == 0) continue;
      const float x = keypoint.x + static_cast<float>(column - kRadius) * keypoint.sigma;
      const HaarResponse haar = Haar(image, x, y, half);
      const float dx = weight * static_cast<float>(haar.dx);
      const float dy = weight * static_cast<float>(haar.dy);
      Vector& sum = sums[Sector(dx, dy)];
      sum.x += dx;
      sum.y += dy;
    }
  }
  return sums;
}

}  // namespace

void AssignOrientation(const IntegralImage& image, Keypoint& keypoint) {
  const SectorSums sums = SumBySector(image, keypoint);
  Vector best;
  float best_length2 = 0;
  for (int first = 0; first < kSectors; ++first) {
    Vector window;
    for (int i = first; i < first + kWindow; ++i) {
      const Vector& sum = sums[i < kSectors ? i : i - kSectors];
      window.x += sum.x;
      window.y += sum.y;
    }
    const float length2 = window.x * window.x + window.y * window.y;
    if (length2 > best_length2) {
      best_length2 = length2;
      best = window;
    }
  }
  const float length = std::sqrt(best_length2);
  keypoint.cos_angle = length > 0 ? best.x / length : 1;
  keypoint.sin_angle = length > 0 ? best.y / length : 0;
}

}  // namespace viewfix
