// SPDX-License-Identifier: BSD-3-Clause
#include "engine/features/fast_hessian.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>

namespace viewfix {
namespace {

// Lobes of each octave's filters. More layers than the paper's four, so that
// octaves overlap: a blob between two of them is found in both, and comes back in
// one of them when the image's scale changes a little.
constexpr int kMaxLayers = 6;
constexpr int kMinLayers = 4;
struct Octave {
  int step;  // pixels between samples
  int layers;
  std::array<int, kMaxLayers> lobes;  // pixels, evenly spaced
};
constexpr int kOctaveCount = 4;
// The first layers of an octave are every second layer and sample of the one before.
constexpr int kSharedLayers = 3;
constexpr std::array<Octave, kOctaveCount> kOctaves = {{
    {1, 6, {3, 5, 7, 9, 11, 13}},
    {2, 6, {5, 9, 13, 17, 21, 25}},
    {4, 6, {9, 17, 25, 33, 41, 49}},
    {8, 4, {17, 33, 49, 65}},
}};

constexpr int kRows = 3;               // of each layer that are held at once
constexpr int kVector = 16;            // floats of the longest vector
constexpr int kMargin = 112;           // column sums to the left of a row: kReach, whole vectors
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

// Rows about a sample: rows[layer][row], three of each, the sample in the middle.
using RowTriple = std::array<const float*, 3>;

// Of equal neighbours the first in order wins, so that a plateau gives one point.
bool ExceedsRow(float value, const float* row, int x, bool earlier) {
  const float* p = row + x;
  if (earlier) return value > p[-1] && value > p[0] && value > p[1];
  return value >= p[-1] && value >= p[0] && value >= p[1];
}

bool IsMaximum(const RowTriple* rows, int x) {
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

// By Newton's method, as std::sqrt is not constexpr.
constexpr double FourthRoot(double x) {
  double root = x;
  for (int i = 0; i < 30; ++i) root = (3 * root + x / (root * root * root)) / 4;
  return root;
}

// By octave and layer: what Strength() multiplies a determinant by at most, and a little for all
// rounding of that and of GreatestResponse().
using Weights = std::array<std::array<double, kMaxLayers>, kOctaveCount>;
constexpr Weights MakeGreatestWeights() {
  Weights weights{};
  for (int o = 0; o < kOctaveCount; ++o) {
    const std::array<int, kMaxLayers>& lobes = kOctaves[o].lobes;
    for (int layer = 1; layer + 1 < kOctaves[o].layers; ++layer) {
      const double greatest_lobe = lobes[layer] + kMaxOffset * (lobes[layer] - lobes[layer - 1]);
      weights[o][layer] = FourthRoot(greatest_lobe * double(kSigmaPerLobe)) * (1 + 1e-6);
    }
  }
  return weights;
}
constexpr Weights kGreatestWeights = MakeGreatestWeights();

// What Refine() can find at most: v + g d / 2, where the gradient g is half the differences of
// the neighbours, and no offset in d exceeds kMaxOffset.
double GreatestResponse(const RowTriple* rows, int x) {
  const float* const middle = rows[1][1];
  const float differences = std::fabs(middle[x + 1] - middle[x - 1]) +
                            std::fabs(rows[1][2][x] - rows[1][0][x]) +
                            std::fabs(rows[2][1][x] - rows[0][1][x]);
  return double{middle[x]} + 0.25 * kMaxOffset * double{differences};
}

Neighbourhood Gather(const RowTriple* rows, int x) {
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

// Rows of the integral image that the filters of one row read, at x = 0.
struct FilterRows {
  FilterRows(const IntegralImage& image, int y, int lobe)
      : reach((3 * lobe - 1) / 2),
        outer_top(image.Row(y - reach)),
        outer_bottom(image.Row(y + reach + 1)),
        wing_top(image.Row(y - (lobe - 1))),
        wing_bottom(image.Row(y + lobe)),
        half_top(image.Row(y - (lobe - 1) / 2)),
        half_bottom(image.Row(y + (lobe - 1) / 2 + 1)),
        lobe_top(image.Row(y - lobe)),
        lobe_bottom(image.Row(y + lobe + 1)),
        above(image.Row(y)),
        below(image.Row(y + 1)) {}

  int reach;
  const std::uint32_t* outer_top;
  const std::uint32_t* outer_bottom;
  const std::uint32_t* wing_top;
  const std::uint32_t* wing_bottom;
  const std::uint32_t* half_top;
  const std::uint32_t* half_bottom;
  const std::uint32_t* lobe_top;
  const std::uint32_t* lobe_bottom;
  const std::uint32_t* above;
  const std::uint32_t* below;
};

// A row of each layer.
using LayerRows = std::array<const float*, kMaxLayers>;

// Loops run over whole vectors, a few samples beyond the row's end: no rests to do one by one.
constexpr int WholeVectors(int count) { return (count + kVector - 1) & -kVector; }

// Sums of pixels down the columns of one row's filters, as differences of the integral image, so
// that what is left are differences along the row; modulo 2^32, thus exact in any order:
//   wing      2 lobe - 1 rows, for xx
//   outer     3 lobe rows less three times the middle lobe rows, for yy
//   diagonal  the lobe rows above less the ones below, for xy
struct ColumnSumsKernel {
  VIEWFIX_KERNEL void Run(const FilterRows* rows, int width, std::uint32_t* wing,
                          std::uint32_t* outer, std::uint32_t* diagonal) {
    Sum(*rows, width, wing, outer, diagonal);
  }

  // Parameters, as the compiler believes __restrict of many pointers of these alone.
  VIEWFIX_KERNEL void Sum(FilterRows rows, int width, std::uint32_t* __restrict wing,
                          std::uint32_t* __restrict outer, std::uint32_t* __restrict diagonal) {
    const int first = -WholeVectors(rows.reach);
    const int count = WholeVectors(width + rows.reach + 1 - first);
    for (int i = 0; i < count; ++i) {
      const int x = first + i;
      wing[x] = rows.wing_bottom[x] - rows.wing_top[x];
      outer[x] =
          rows.outer_bottom[x] - rows.outer_top[x] - 3 * (rows.half_bottom[x] - rows.half_top[x]);
      diagonal[x] = rows.above[x] - rows.lobe_top[x] - (rows.lobe_bottom[x] - rows.below[x]);
    }
  }
};

// Responses of one row at every pixel 0..width-1.
struct ResponseKernel {
  VIEWFIX_KERNEL void Run(const std::uint32_t* wing, const std::uint32_t* outer,
                          const std::uint32_t* diagonal, int lobe, int width, float* out) {
    float* __restrict responses = out;
    const int reach = (3 * lobe - 1) / 2;
    const int half = (lobe - 1) / 2;
    const float unit = UnitArea(lobe);
    const int count = WholeVectors(width);
    for (int x = 0; x < count; ++x) {
      const std::uint32_t xx =
          wing[x + reach + 1] - wing[x - reach] - 3 * (wing[x + half + 1] - wing[x - half]);
      const std::uint32_t yy = outer[x + lobe] - outer[x - lobe + 1];
      const std::uint32_t xy =
          diagonal[x] - diagonal[x - lobe] - (diagonal[x + lobe + 1] - diagonal[x + 1]);
      const float dxx = static_cast<float>(static_cast<std::int32_t>(xx)) * unit;
      const float dyy = static_cast<float>(static_cast<std::int32_t>(yy)) * unit;
      const float dxy = static_cast<float>(static_cast<std::int32_t>(xy)) * unit;
      responses[x] = dxx * dyy - kDxyWeight2 * (dxy * dxy);
    }
  }
};

// Every kStep-th sample.
template <int kStep>
struct ThinKernel {
  VIEWFIX_KERNEL void Run(const float* dense, int columns, float* out) {
    float* __restrict thin = out;
    for (int i = 0; i < columns; ++i) thin[i] = dense[kStep * i];
  }
};

[[gnu::always_inline]] inline float Greater(float a, float b) { return a > b ? a : b; }

// The greatest of a layer's three rows, column by column.
struct GreatestKernel {
  VIEWFIX_KERNEL void Run(const float* a, const float* b, const float* c, int columns, float* out) {
    float* __restrict greatest = out;
    const int count = WholeVectors(columns);
    for (int x = 0; x < count; ++x) greatest[x] = Greater(Greater(a[x], b[x]), c[x]);
  }
};

// Marks the samples of at least `least` that no neighbour exceeds, nearly all of which are maxima:
// bit `layer` of a byte each, of the layers between the finest and the coarsest. A float lies
// before and after each row.
//   greatest  of three rows of each layer, column by column
template <int kLayers>
struct CandidateKernel {
  static_assert(kLayers % 2 == 0, "layers between the outer ones are taken in pairs");

  VIEWFIX_KERNEL void Run(const LayerRows* values, const LayerRows* greatest, float least,
                          int columns, std::uint8_t* out) {
    std::uint8_t* __restrict marks = out;
    const LayerRows v = *values;
    const LayerRows g = *greatest;
    const int count = WholeVectors(columns);
    for (int x = 0; x < count; ++x) {
      std::array<float, kLayers> peaks;
      for (int layer = 0; layer < kLayers; ++layer) {
        peaks[layer] = Greater(Greater(g[layer][x - 1], g[layer][x]), g[layer][x + 1]);
      }
      std::int32_t mark = 0;
      for (int layer = 1; layer + 1 < kLayers; layer += 2) {
        const float both = Greater(Greater(peaks[layer], peaks[layer + 1]), least);
        mark |= v[layer][x] >= Greater(both, peaks[layer - 1]) ? 1 << layer : 0;
        mark |= v[layer + 1][x] >= Greater(both, peaks[layer + 2]) ? 2 << layer : 0;
      }
      marks[x] = static_cast<std::uint8_t>(mark);
    }
  }
};

}  // namespace

FastHessian::FastHessian(int max_image_side, CpuPath path)
    : path_(path),
      stride_(WholeVectors(max_image_side)),
      responses_(std::size_t(kOctaveCount * kMaxLayers * kRows * stride_ + 2 * kVector)),
      greatest_(std::size_t(kMaxLayers * stride_ + 2 * kVector)),
      column_sums_(std::size_t(3 * ColumnSumsLength())),
      dense_(std::size_t(stride_)),
      marks_(std::size_t(stride_)) {}

int FastHessian::ColumnSumsLength() const { return kMargin + WholeVectors(stride_ + kReach + 1); }

float* FastHessian::Row(int octave, int layer, int row) {
  const int idx = (octave * kMaxLayers + layer) * kRows + row % kRows;
  return responses_.data() + kVector + idx * stride_;
}

float* FastHessian::GreatestRow(int layer) { return greatest_.data() + kVector + layer * stride_; }

void FastHessian::Thin(const float* dense, int step, int columns, float* responses) {
  if (step == 2) return RunOnPath<ThinKernel<2>>(path_, dense, columns, responses);
  if (step == 4) return RunOnPath<ThinKernel<4>>(path_, dense, columns, responses);
  RunOnPath<ThinKernel<8>>(path_, dense, columns, responses);
}

void FastHessian::ResponseRow(const IntegralImage& image, int y, int lobe, int step, int count,
                              float* responses) {
  const FilterRows rows(image, y, lobe);
  const int width = (count - 1) * step + 1;
  std::uint32_t* const wing = column_sums_.data() + kMargin;
  std::uint32_t* const outer = wing + ColumnSumsLength();
  std::uint32_t* const diagonal = outer + ColumnSumsLength();
  RunOnPath<ColumnSumsKernel>(path_, &rows, width, wing, outer, diagonal);
  RunOnPath<ResponseKernel>(path_, wing, outer, diagonal, lobe, width,
                            step == 1 ? responses : dense_.data());
  if (step != 1) Thin(dense_.data(), step, count, responses);
}

// Octave by octave, what the one before has of a row first.
void FastHessian::FillRow(const IntegralImage& image, int octave, int row, int columns) {
  const Octave& shape = kOctaves[octave];
  for (int layer = 0; layer < shape.layers; ++layer) {
    float* const responses = Row(octave, layer, row);
    if (octave > 0 && layer < kSharedLayers) {
      Thin(Row(octave - 1, 2 * layer + 1, 2 * row), 2, columns, responses);
    } else {
      ResponseRow(image, row * shape.step, shape.lobes[layer], shape.step, columns, responses);
    }
  }
}

void FastHessian::Detect(const IntegralImage& image, float threshold, GridSelector& selector) {
  for (int y = 0; y < image.height(); ++y) {
    for (int octave = 0; octave < kOctaveCount; ++octave) {
      const int step = kOctaves[octave].step;
      if (y % step != 0) break;
      const int columns = SamplesAcross(image.width(), step);
      FillRow(image, octave, y / step, columns);
      if (y / step < kRows - 1) continue;
      SearchRow(image, octave, y / step - 1, columns, threshold, selector);
    }
  }
}

// The last but one that was filled.
void FastHessian::SearchRow(const IntegralImage& image, int octave, int row, int columns,
                            float threshold, GridSelector& selector) {
  std::array<RowTriple, kMaxLayers> rows;
  LayerRows values;
  LayerRows greatest;
  for (int layer = 0; layer < kMaxLayers; ++layer) {
    for (int i = 0; i < kRows; ++i) rows[layer][i] = Row(octave, layer, row + i - 1);
    values[layer] = rows[layer][1];
    greatest[layer] = GreatestRow(layer);
  }
  for (int layer = 0; layer < kOctaves[octave].layers; ++layer) {
    const auto& [above, middle, below] = rows[layer];
    RunOnPath<GreatestKernel>(path_, above, middle, below, columns, GreatestRow(layer));
  }
  const float least = std::nextafter(threshold, std::numeric_limits<float>::max());
  if (kOctaves[octave].layers == kMaxLayers) {
    RunOnPath<CandidateKernel<kMaxLayers>>(path_, &values, &greatest, least, columns,
                                           marks_.data());
  } else {
    RunOnPath<CandidateKernel<kMinLayers>>(path_, &values, &greatest, least, columns,
                                           marks_.data());
  }
  for (int i = 0; i < columns; i += 8) {
    std::uint64_t marks;
    std::memcpy(&marks, &marks_[i], sizeof(marks));
    for (; marks != 0; marks &= marks - 1) {
      const int bit = std::countr_zero(marks);
      const int column = i + bit / 8, layer = bit % 8;
      if (column < 1 || column >= columns - 1) continue;
      const double response = GreatestResponse(&rows[layer - 1], column);
      const double strength = response * kGreatestWeights[octave][layer];
      if (!selector.MayChoose(static_cast<float>(strength))) continue;
      if (!IsMaximum(&rows[layer - 1], column)) continue;
      const std::optional<Refined> refined = Refine(Gather(&rows[layer - 1], column));
      if (refined) {
        selector.Add(MakeKeypoint(image, kOctaves[octave], layer, column, row, *refined));
      }
    }
  }
}

}  // namespace viewfix
