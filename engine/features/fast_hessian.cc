// SPDX-License-Identifier: BSD-3-Clause
#include "engine/features/fast_hessian.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>

namespace viewfix {
namespace {

// Lobes of each octave's filters. More layers than the paper's four, so that
// octaves overlap: a blob between two of them is found in both, and comes back in
// one of them when the image's scale changes a little.
constexpr int kMaxLayers = 6;
struct Octave {
  int step;  // pixels between samples
  int layers;
  std::array<int, kMaxLayers> lobes;  // pixels, evenly spaced
};
constexpr std::array<Octave, 4> kOctaves = {{
    {1, 6, {3, 5, 7, 9, 11, 13}},
    {2, 6, {5, 9, 13, 17, 21, 25}},
    {4, 6, {9, 17, 25, 33, 41, 49}},
    {8, 4, {17, 33, 49, 65}},
}};

constexpr int kRows = 3;               // of each layer that are held at once
constexpr float kSigmaPerLobe = 0.4F;  // a filter of 9 pixels, lobe 3, is a Gaussian of 1.2
constexpr float kDxyWeight2 = 0.81F;   // (0.9)^2, equation (3) of [1]
constexpr double kMaxOffset = 1;       // samples; beyond, the quadratic does not describe the peak

// Unnormalized second derivatives by boxes, the filter centred on pixel (x, y).
struct Boxes {
  std::int32_t xx;
  std::int32_t yy;
  std::int32_t xy;
};

Boxes BoxesAt(const IntegralImage& image, int x, int y, int lobe) {
  const int reach = (3 * lobe - 1) / 2;
  const int half = (lobe - 1) / 2;
  const int wing = lobe - 1;
  Boxes boxes;
  boxes.xx = image.BoxSum(x - reach, y - wing, x + reach + 1, y + wing + 1) -
             3 * image.BoxSum(x - half, y - wing, x + half + 1, y + wing + 1);
  boxes.yy = image.BoxSum(x - wing, y - reach, x + wing + 1, y + reach + 1) -
             3 * image.BoxSum(x - wing, y - half, x + wing + 1, y + half + 1);
  boxes.xy = image.BoxSum(x - lobe, y - lobe, x, y) +
             image.BoxSum(x + 1, y + 1, x + lobe + 1, y + lobe + 1) -
             image.BoxSum(x + 1, y - lobe, x + lobe + 1, y) -
             image.BoxSum(x - lobe, y + 1, x, y + lobe + 1);
  return boxes;
}

float UnitArea(int lobe) {
  return 1.0F / (255.0F * 9.0F * static_cast<float>(lobe) * static_cast<float>(lobe));
}

// The 27 responses around a sample: v[layer][row][column], each 0..2.
using Neighbourhood = std::array<std::array<std::array<double, 3>, 3>, 3>;

struct Refined {
  double dx, dy, ds;  // samples from the middle one
  double response;
};

// Maximum of the quadratic through the neighbourhood: solves H d = -g (M. Brown,
// D. Lowe, BMVC 2002) by Cramer's rule. None if it lies outside kMaxOffset.
std::optional<Refined> Refine(const Neighbourhood& v) {
  const double mid2 = 2 * v[1][1][1];
  const double gx = (v[1][1][2] - v[1][1][0]) / 2;
  const double gy = (v[1][2][1] - v[1][0][1]) / 2;
  const double gs = (v[2][1][1] - v[0][1][1]) / 2;
  const double xx = v[1][1][2] + v[1][1][0] - mid2;
  const double yy = v[1][2][1] + v[1][0][1] - mid2;
  const double ss = v[2][1][1] + v[0][1][1] - mid2;
  const double xy = (v[1][2][2] - v[1][2][0] - v[1][0][2] + v[1][0][0]) / 4;
  const double xs = (v[2][1][2] - v[2][1][0] - v[0][1][2] + v[0][1][0]) / 4;
  const double ys = (v[2][2][1] - v[2][0][1] - v[0][2][1] + v[0][0][1]) / 4;

  const double cxx = yy * ss - ys * ys;  // cofactors of the symmetric H
  const double cxy = xs * ys - xy * ss;
  const double cxs = xy * ys - xs * yy;
  const double cyy = xx * ss - xs * xs;
  const double cys = xy * xs - xx * ys;
  const double css = xx * yy - xy * xy;
  const double det = xx * cxx + xy * cxy + xs * cxs;
  if (!(xx < 0 && css > 0 && det < 0)) return std::nullopt;  // not a maximum

  Refined refined;
  refined.dx = -(cxx * gx + cxy * gy + cxs * gs) / det;
  refined.dy = -(cxy * gx + cyy * gy + cys * gs) / det;
  refined.ds = -(cxs * gx + cys * gy + css * gs) / det;
  const auto inside = [](double offset) { return std::fabs(offset) <= kMaxOffset; };
  if (!inside(refined.dx) || !inside(refined.dy) || !inside(refined.ds)) return std::nullopt;
  refined.response = v[1][1][1] + 0.5 * (gx * refined.dx + gy * refined.dy + gs * refined.ds);
  return refined;
}

// Rows about a sample: rows[layer][row], each 0..2, the sample in the middle.
using RowTriples = std::array<std::array<const float*, 3>, 3>;

// Of equal neighbours the first in order wins, so that a plateau gives one point.
bool ExceedsRow(float value, const float* row, int x, bool earlier) {
  const float* p = row + x;
  if (earlier) return value > p[-1] && value > p[0] && value > p[1];
  return value >= p[-1] && value >= p[0] && value >= p[1];
}

bool IsMaximum(const RowTriples& rows, int x) {
  const float value = rows[1][1][x];
  if (value <= rows[1][1][x - 1] || value < rows[1][1][x + 1]) return false;
  if (!ExceedsRow(value, rows[1][0], x, true) || !ExceedsRow(value, rows[1][2], x, false)) {
    return false;
  }
  for (int row = 0; row < 3; ++row) {
    if (!ExceedsRow(value, rows[0][row], x, true)) return false;
    if (!ExceedsRow(value, rows[2][row], x, false)) return false;
  }
  return true;
}

Neighbourhood Gather(const RowTriples& rows, int x) {
  Neighbourhood v;
  for (int layer = 0; layer < 3; ++layer) {
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        v[layer][row][column] = double(rows[layer][row][x + column - 1]);
      }
    }
  }
  return v;
}

// Ranks larger blobs a little higher than their determinant does: they survive blur
// and compression better.
float Strength(double determinant, double sigma) {
  return static_cast<float>(determinant * std::sqrt(std::sqrt(sigma)));
}

// Sample (column, row) of a layer, moved by what Refine() found.
Keypoint MakeKeypoint(const IntegralImage& image, const Octave& octave, int layer, int column,
                      int row, const Refined& refined) {
  const int lobe = octave.lobes[layer];
  const int lobe_step = lobe - octave.lobes[layer - 1];
  Keypoint keypoint;
  keypoint.x = static_cast<float>((column + refined.dx) * octave.step);
  keypoint.y = static_cast<float>((row + refined.dy) * octave.step);
  keypoint.sigma = static_cast<float>((lobe + refined.ds * lobe_step) * double(kSigmaPerLobe));
  keypoint.response = Strength(refined.response, double(keypoint.sigma));
  const Boxes boxes = BoxesAt(image, column * octave.step, row * octave.step, lobe);
  keypoint.laplacian_sign = boxes.xx + boxes.yy > 0 ? 1 : -1;
  return keypoint;
}

int SamplesAcross(int side, int step) { return (side + step - 1) / step; }

}  // namespace

FastHessian::FastHessian(int max_image_side)
    : max_columns_(max_image_side),
      responses_(std::size_t(kMaxLayers * kRows) * std::size_t(max_image_side)) {}

float* FastHessian::Row(int layer, int row) {
  return responses_.data() + std::size_t(layer * kRows + row % kRows) * std::size_t(max_columns_);
}

void FastHessian::ResponseRow(const IntegralImage& image, int y, int lobe, int step, int count,
                              float* responses) {
  const int reach = (3 * lobe - 1) / 2;
  const int half = (lobe - 1) / 2;
  const int wing = lobe - 1;
  const std::uint32_t* outer_top = image.Row(y - reach);
  const std::uint32_t* outer_bottom = image.Row(y + reach + 1);
  const std::uint32_t* wing_top = image.Row(y - wing);
  const std::uint32_t* wing_bottom = image.Row(y + wing + 1);
  const std::uint32_t* half_top = image.Row(y - half);
  const std::uint32_t* half_bottom = image.Row(y + half + 1);
  const std::uint32_t* lobe_top = image.Row(y - lobe);
  const std::uint32_t* lobe_bottom = image.Row(y + lobe + 1);
  const std::uint32_t* above = image.Row(y);
  const std::uint32_t* below = image.Row(y + 1);
  const float unit = UnitArea(lobe);

  const auto sum = [](const std::uint32_t* top, const std::uint32_t* bottom, int x0, int x1) {
    return bottom[x1] - bottom[x0] - top[x1] + top[x0];
  };
  for (int i = 0; i < count; ++i) {
    const int x = i * step;
    const std::uint32_t xx = sum(wing_top, wing_bottom, x - reach, x + reach + 1) -
                             3 * sum(wing_top, wing_bottom, x - half, x + half + 1);
    const std::uint32_t yy = sum(outer_top, outer_bottom, x - wing, x + wing + 1) -
                             3 * sum(half_top, half_bottom, x - wing, x + wing + 1);
    const std::uint32_t xy =
        sum(lobe_top, above, x - lobe, x) + sum(below, lobe_bottom, x + 1, x + lobe + 1) -
        sum(lobe_top, above, x + 1, x + lobe + 1) - sum(below, lobe_bottom, x - lobe, x);
    const float dxx = static_cast<float>(static_cast<std::int32_t>(xx)) * unit;
    const float dyy = static_cast<float>(static_cast<std::int32_t>(yy)) * unit;
    const float dxy = static_cast<float>(static_cast<std::int32_t>(xy)) * unit;
    responses[i] = dxx * dyy - kDxyWeight2 * (dxy * dxy);
  }
}

void FastHessian::Detect(const IntegralImage& image, float threshold, GridSelector& selector) {
  for (std::size_t octave_idx = 0; octave_idx < kOctaves.size(); ++octave_idx) {
    const Octave& octave = kOctaves[octave_idx];
    const int columns = SamplesAcross(image.width(), octave.step);
    const int rows = SamplesAcross(image.height(), octave.step);
    for (int row = 0; row < rows; ++row) {
      for (int layer = 0; layer < octave.layers; ++layer) {
        ResponseRow(image, row * octave.step, octave.lobes[layer], octave.step, columns,
                    Row(layer, row));
      }
      if (row < kRows - 1) continue;
      for (int layer = 1; layer + 1 < octave.layers; ++layer) {
        SearchRow(image, octave_idx, layer, row - 1, columns, threshold, selector);
      }
    }
  }
}

void FastHessian::SearchRow(const IntegralImage& image, std::size_t octave_idx, int layer, int row,
                            int columns, float threshold, GridSelector& selector) {
  RowTriples rows;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) rows[i][j] = Row(layer + i - 1, row + j - 1);
  }
  for (int x = 1; x + 1 < columns; ++x) {
    if (!(rows[1][1][x] > threshold) || !IsMaximum(rows, x)) continue;
    const std::optional<Refined> refined = Refine(Gather(rows, x));
    if (!refined) continue;
    selector.Add(MakeKeypoint(image, kOctaves[octave_idx], layer, x, row, *refined));
  }
}

}  // namespace viewfix
