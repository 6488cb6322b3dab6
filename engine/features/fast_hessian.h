// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/base/aligned_vector.h"
#include "engine/base/cpu_path.h"
#include "engine/features/grid_selector.h"
#include "engine/image/integral_image.h"

namespace viewfix {

// Blobs of an image: maxima over place and scale of the determinant of the
// Hessian, approximated by box filters (section 3 of [1]):
//   det = Dxx Dyy - (0.9 Dxy)^2, over the filter's area squared, grey in 0..1.
// A filter of side 3 l (l the lobe, odd) has the scale 0.4 l as in the paper; a
// Gaussian blob is found at about 3/4 of its own standard deviation. Maxima are refined to
// fractions of a pixel and of a scale step by a quadratic. The first octave is sampled at every
// pixel, octave o at every 2^o-th.
//
// Memory is allocated by the constructor alone. One instance serves one thread.
// [1] H. Bay et al., Speeded-Up Robust Features, CVIU 110 (2008).
class FastHessian {
 public:
  // Pixels that the largest filter reaches beyond the one it is placed on:
  // the least border of the integral image.
  static constexpr int kReach = 98;

  explicit FastHessian(int max_image_side, CpuPath path = BestCpuPath());

  // Adds to `selector` every blob of det > threshold >= 0 (orientation not set),
  // its response the refined det times the fourth root of its sigma.
  void Detect(const IntegralImage& image, float threshold, GridSelector& selector);

  // The determinant of lobe `lobe` at columns 0, step, 2 step ... of row y, `count` of them, in
  // `responses`, which has room for whole vectors of 16. Public for tests.
  void ResponseRow(const IntegralImage& image, int y, int lobe, int step, int count,
                   float* responses);

 private:
  int ColumnSumsLength() const;
  float* Row(int octave, int layer, int row);
  float* GreatestRow(int layer);
  void Thin(const float* dense, int step, int columns, float* responses);
  void FillRow(const IntegralImage& image, int octave, int row, int columns);
  void SearchRow(const IntegralImage& image, int octave, int row, int columns, float threshold,
                 GridSelector& selector);

  CpuPath path_;
  int stride_;                                // floats a row, whole vectors
  AlignedVector<float> responses_;            // [octave][layer][3 rows, used in turn][stride_]
  AlignedVector<float> greatest_;             // [layer][stride_]: of the three rows
  AlignedVector<std::uint32_t> column_sums_;  // [3][ColumnSumsLength()]
  AlignedVector<float> dense_;                // [stride_] a row at every pixel
  AlignedVector<std::uint8_t> marks_;         // [stride_] bit of each layer with a candidate
};

}  // namespace viewfix
