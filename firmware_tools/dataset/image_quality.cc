// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/dataset/image_quality.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace viewfix {
namespace {

constexpr int kDark = 16;
constexpr int kBright = 247;
constexpr double kFineSigma = 1.0;    // pixels: below it, noise and JPEG decide
constexpr double kCoarseSigma = 3.0;  // pixels
constexpr double kMaxBlur = 20;       // pixels: beyond it the ratio says no more than "much"
constexpr float kLeastGradient = 2;   // grey values a pixel, after kCoarseSigma
constexpr double kEdgeShare = 0.02;   // of the pixels: the strongest edges are asked
constexpr std::size_t kLeastEdges = 50;

cv::Mat Smoothed(const cv::Mat& image, double sigma) {
  cv::Mat smooth;
  cv::GaussianBlur(image, smooth, {}, sigma);
  return smooth;
}

// Central differences along x. The image has at least 3 columns.
cv::Mat GradientX(const cv::Mat& image) {
  cv::Mat gradient = cv::Mat::zeros(image.size(), CV_32F);
  gradient.colRange(1, image.cols - 1) =
      0.5 * cv::abs(image.colRange(2, image.cols) - image.colRange(0, image.cols - 2));
  return gradient;
}

struct Edge {
  float coarse = 0;
  float ratio = 0;  // fine gradient / coarse gradient
};

// Pixels where the coarse gradient has a maximum along x.
std::vector<Edge> EdgesAlongX(const cv::Mat& fine, const cv::Mat& coarse) {
  std::vector<Edge> edges;
  for (int y = 0; y < coarse.rows; ++y) {
    const float* c = coarse.ptr<float>(y);
    const float* f = fine.ptr<float>(y);
    for (int x = 2; x + 2 < coarse.cols; ++x) {
      if (c[x] < kLeastGradient || c[x] < c[x - 1] || c[x] <= c[x + 1]) continue;
      edges.push_back({c[x], std::max({f[x - 1], f[x], f[x + 1]}) / c[x]});
    }
  }
  return edges;
}

// s of ratio = sqrt((s^2 + coarse^2) / (s^2 + fine^2)).
double BlurOfRatio(double ratio) {
  const double r2 = ratio * ratio;
  const double s2 = (kCoarseSigma * kCoarseSigma - r2 * kFineSigma * kFineSigma) / (r2 - 1);
  if (r2 <= 1 || s2 > kMaxBlur * kMaxBlur) return kMaxBlur;
  return std::sqrt(std::max(s2, 0.0));
}

// `fine` and `coarse`: the image under both smoothings.
std::optional<double> BlurAlongX(const cv::Mat& fine, const cv::Mat& coarse) {
  if (fine.cols < 8 || fine.rows < 8) return std::nullopt;
  std::vector<Edge> edges = EdgesAlongX(GradientX(fine), GradientX(coarse));
  if (edges.size() < kLeastEdges) return std::nullopt;
  const auto wanted = static_cast<std::size_t>(kEdgeShare * static_cast<double>(fine.total()));
  const std::size_t count = std::min(edges.size(), std::max(wanted, kLeastEdges));
  std::nth_element(edges.begin(), edges.begin() + (count - 1), edges.end(),
                   [](const Edge& a, const Edge& b) { return a.coarse > b.coarse; });
  const auto middle = edges.begin() + count / 2;
  std::nth_element(edges.begin(), middle, edges.begin() + count,
                   [](const Edge& a, const Edge& b) { return a.ratio < b.ratio; });
  return BlurOfRatio(double{middle->ratio});
}

}  // namespace

ImageQuality MeasureQuality(const ImageView& image) {
  ImageQuality quality;
  if (image.empty()) return quality;
  const cv::Mat bytes(image.height, image.width, CV_8U, const_cast<std::uint8_t*>(image.pixels),
                      static_cast<std::size_t>(image.row_bytes));
  const auto total = static_cast<double>(bytes.total());
  quality.mean = cv::mean(bytes)[0];
  quality.dark_share = cv::countNonZero(bytes < kDark) / total;
  quality.bright_share = cv::countNonZero(bytes > kBright) / total;
  cv::Mat pixels;
  bytes.convertTo(pixels, CV_32F);
  const cv::Mat fine = Smoothed(pixels, kFineSigma);
  const cv::Mat coarse = Smoothed(pixels, kCoarseSigma);
  const std::optional<double> along_x = BlurAlongX(fine, coarse);
  const std::optional<double> along_y = BlurAlongX(fine.t(), coarse.t());
  quality.blur_px = along_x && along_y ? std::max(*along_x, *along_y) : along_x ? along_x : along_y;
  return quality;
}

}  // namespace viewfix
