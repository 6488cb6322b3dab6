// SPDX-License-Identifier: BSD-3-Clause
#include "engine/image/image_quality.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <iterator>

namespace viewfix {
namespace {

constexpr int kDark = 16;
constexpr int kBright = 247;

// Seen on hand-held video at 640 pixels: beyond it a human calls every image blurred.
constexpr double kBlurredPx = 2.8;
// No image of the sets that Viewfix is measured on comes near: the darkest has 0.47 and 61, the
// brightest 0.23 and 187.
constexpr double kDarkShare = 0.6;
constexpr double kDarkMean = 30;
constexpr double kBrightShare = 0.35;
constexpr double kBrightMean = 225;

constexpr int kReach = 8;            // pixels on either side of an edge
constexpr int kRows = 3;             // that are added up: noise has no edges
constexpr int kLeastContrast = 12;   // grey values
constexpr int kEvery = 2;            // of the lines of pixels, one is looked at
constexpr double kEdgeShare = 0.02;  // of the pixels: the strongest edges are asked
constexpr int kLeastEdges = 25;

// Edges by contrast, and by ratio in steps of 1 / kRatioOne; what is beyond counts as the last.
constexpr int kContrasts = 32;
constexpr int kRatioOne = 128;
constexpr int kRatios = 192;

struct Edges {
  std::array<std::array<std::uint32_t, kRatios>, kContrasts> count = {};

  void Add(int near, int far) {
    const int contrast = std::min(far * kContrasts / (kReach * kRows * 256), kContrasts - 1);
    const int ratio = std::min(near * kReach * kRatioOne / far, kRatios - 1);
    ++count[contrast][ratio];
  }
};

// A line of pixels, each the sum of kRows side by side.
struct Line {
  const std::uint8_t* pixels;  // the middle one's
  std::ptrdiff_t along;
  std::ptrdiff_t across;

  int operator[](int i) const {
    const std::uint8_t* p = pixels + i * along;
    return p[-across] + p[0] + p[across];
  }
};

// Pixels where the far difference has a maximum along the line.
void AddEdges(const Line& line, int length, Edges& edges) {
  constexpr int kLeastFar = kLeastContrast * kReach * kRows;
  int sum = 0;  // of the kReach after i, less those before
  for (int k = 1; k <= kReach; ++k) sum += line[kReach + k] - line[kReach - k];
  int before = 0;
  int far = std::abs(sum);
  for (int i = kReach; i + kReach + 1 < length; ++i) {
    sum += line[i + kReach + 1] - line[i + 1] - line[i] + line[i - kReach];
    const int after = std::abs(sum);
    if (far >= kLeastFar && far >= before && far > after) {
      const int near =
          std::max({std::abs(line[i] - line[i - 2]), std::abs(line[i + 1] - line[i - 1]),
                    std::abs(line[i + 2] - line[i])});
      edges.Add(near, far);
    }
    before = far;
    far = after;
  }
}

// The ratio of an edge of blur s.
struct RatioOfBlur {
  double ratio;
  double blur_px;
};
constexpr RatioOfBlur kRatioOfBlur[] = {
    {0.9992, 0.3}, {0.96, 0.5}, {0.8375, 0.75}, {0.7154, 1},  {0.6189, 1.25},
    {0.5456, 1.5}, {0.4459, 2}, {0.3838, 2.5},  {0.3431, 3},  {0.2958, 4},
    {0.2711, 5},   {0.2568, 6}, {0.242, 8},     {0.2311, 12}, {0.2255, 20}};

double BlurOfRatio(double ratio) {
  if (ratio >= kRatioOfBlur[0].ratio) return kRatioOfBlur[0].blur_px;
  for (std::size_t i = 1; i < std::size(kRatioOfBlur); ++i) {
    const RatioOfBlur& sharper = kRatioOfBlur[i - 1];
    const RatioOfBlur& softer = kRatioOfBlur[i];
    if (ratio < softer.ratio) continue;
    const double share = (sharper.ratio - ratio) / (sharper.ratio - softer.ratio);
    return sharper.blur_px + share * (softer.blur_px - sharper.blur_px);
  }
  return std::rbegin(kRatioOfBlur)->blur_px;
}

double MedianRatio(const std::array<std::uint64_t, kRatios>& count, std::uint64_t total) {
  std::uint64_t below = 0;
  int ratio = 0;
  while (2 * (below + count[ratio]) < total) below += count[ratio++];
  const double inside = (0.5 * static_cast<double>(total) - static_cast<double>(below)) /
                        static_cast<double>(count[ratio]);
  return (ratio + inside) / kRatioOne;
}

// Of the strongest edges: those of the highest contrasts, until there are `wanted`.
std::optional<double> BlurOf(const Edges& edges, std::uint64_t wanted) {
  std::array<std::uint64_t, kRatios> count = {};
  std::uint64_t total = 0;
  for (int contrast = kContrasts - 1; contrast >= 0 && total < wanted; --contrast) {
    for (int ratio = 0; ratio < kRatios; ++ratio) {
      count[ratio] += edges.count[contrast][ratio];
      total += edges.count[contrast][ratio];
    }
  }
  if (total < kLeastEdges) return std::nullopt;
  return BlurOfRatio(MedianRatio(count, total));
}

// Along lines of `length` pixels, of which `lines` lie side by side.
std::optional<double> BlurAlong(const Line& first, int length, int lines) {
  Edges edges;
  for (int i = 1; i + 1 < lines; i += kEvery) {
    AddEdges({first.pixels + i * first.across, first.along, first.across}, length, edges);
  }
  const double pixels = static_cast<double>(length) * lines / kEvery;
  return BlurOf(edges, std::max(kLeastEdges, static_cast<int>(kEdgeShare * pixels)));
}

std::optional<double> Blur(const ImageView& image) {
  constexpr int kLeastSide = 2 * kReach + 2;
  if (image.width < kLeastSide || image.height < kLeastSide) return std::nullopt;
  const auto along_x = BlurAlong({image.pixels, 1, image.row_bytes}, image.width, image.height);
  const auto along_y = BlurAlong({image.pixels, image.row_bytes, 1}, image.height, image.width);
  return along_x && along_y ? std::max(*along_x, *along_y) : along_x ? along_x : along_y;
}

}  // namespace

bool ImageQuality::blurred() const { return blur_px && *blur_px > kBlurredPx; }
bool ImageQuality::dark() const { return dark_share > kDarkShare || mean < kDarkMean; }
bool ImageQuality::overexposed() const { return bright_share > kBrightShare || mean > kBrightMean; }

ImageQuality MeasureQuality(const ImageView& image) {
  ImageQuality quality;
  if (image.empty()) return quality;
  std::int64_t sum = 0;
  std::int64_t dark = 0;
  std::int64_t bright = 0;
  for (int y = 0; y < image.height; ++y) {
    const std::uint8_t* row = image.Row(y);
    int row_sum = 0;
    int row_dark = 0;
    int row_bright = 0;
    for (int x = 0; x < image.width; ++x) {
      row_sum += row[x];
      row_dark += row[x] < kDark ? 1 : 0;
      row_bright += row[x] > kBright ? 1 : 0;
    }
    sum += row_sum;
    dark += row_dark;
    bright += row_bright;
  }
  const auto pixels = static_cast<double>(std::int64_t{image.width} * image.height);
  quality.mean = static_cast<double>(sum) / pixels;
  quality.dark_share = static_cast<double>(dark) / pixels;
  quality.bright_share = static_cast<double>(bright) / pixels;
  quality.blur_px = Blur(image);
  return quality;
}

}  // namespace viewfix
