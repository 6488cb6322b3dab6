// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/sift_extractor.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <span>
#include <string>
#include <vector>

#include "engine/features/grid_selector.h"
#include "firmware_tools/dataset/image_set.h"

namespace viewfix {
namespace {

constexpr int kSiftDim = 128;
constexpr std::uint32_t kSiftVersion = 1;
constexpr float kLength = 127;
// Lower than OpenCV's 0.04, as the grid picks the best of many.
constexpr double kContrastThreshold = 0.01;
constexpr int kOctaveLayers = 3;
constexpr double kEdgeThreshold = 10;
constexpr double kFirstSigma = 1.6;

Keypoint FromOpenCv(const cv::KeyPoint& point) {
  const double angle = point.angle * CV_PI / 180;
  Keypoint keypoint;
  keypoint.x = point.pt.x;
  keypoint.y = point.pt.y;
  keypoint.sigma = point.size / 2;
  keypoint.cos_angle = static_cast<float>(std::cos(angle));
  keypoint.sin_angle = static_cast<float>(std::sin(angle));
  keypoint.response = point.response;
  keypoint.laplacian_sign = 0;
  return keypoint;
}

// Place, scale and orientation: what tells one SIFT point from another.
using Identity = std::array<float, 5>;

Identity IdentityOf(const Keypoint& keypoint) {
  return {keypoint.x, keypoint.y, keypoint.sigma, keypoint.cos_angle, keypoint.sin_angle};
}

void RootSift(const float* values, std::span<std::int8_t> descriptor) {
  float sum = 0;
  for (int i = 0; i < kSiftDim; ++i) sum += values[i];
  for (int i = 0; i < kSiftDim; ++i) {
    const float root = sum > 0 ? kLength * std::sqrt(values[i] / sum) : 0;
    descriptor[i] = static_cast<std::int8_t>(std::lround(root));
  }
}

class SiftExtractor final : public FeatureExtractor {
 public:
  explicit SiftExtractor(const FeatureOptions& options)
      : options_(options),
        sift_(cv::SIFT::create(0, kOctaveLayers, kContrastThreshold, kEdgeThreshold, kFirstSigma)),
        selector_(options.max_image_side, options.max_features) {}

  int descriptor_dim() const override { return kSiftDim; }
  std::uint32_t version() const override { return kSiftVersion; }

  Status Extract(const ImageView& image, FeatureSet& features) override {
    const Status status = CheckExtractArguments(*this, options_, image, features);
    if (!status.ok()) return status;
    const cv::Mat pixels(image.height, image.width, CV_8UC1,
                         const_cast<std::uint8_t*>(image.pixels),
                         static_cast<std::size_t>(image.row_bytes));
    std::vector<cv::KeyPoint> found;
    sift_->detect(pixels, found);
    Select(image, found, features);
    Describe(pixels, found, features);
    return {};
  }

 private:
  // Leaves in `found` the chosen points, in the order of `features`.
  void Select(const ImageView& image, std::vector<cv::KeyPoint>& found, FeatureSet& features) {
    std::map<Identity, cv::KeyPoint> by_identity;
    selector_.Start(image.width, image.height);
    for (cv::KeyPoint& point : found) {
      if (options_.upright) point.angle = 0;
      const Keypoint keypoint = FromOpenCv(point);
      if (by_identity.emplace(IdentityOf(keypoint), point).second) selector_.Add(keypoint);
    }
    selector_.Select(features);
    found.clear();
    for (const Keypoint& keypoint : features.keypoints()) {
      found.push_back(by_identity.at(IdentityOf(keypoint)));
    }
  }

  void Describe(const cv::Mat& pixels, std::vector<cv::KeyPoint>& points, FeatureSet& features) {
    if (points.empty()) return;
    cv::Mat descriptors;
    sift_->compute(pixels, points, descriptors);
    for (int i = 0; i < features.size(); ++i) {
      RootSift(descriptors.ptr<float>(i), features.mutable_descriptor(i));
    }
  }

  FeatureOptions options_;
  cv::Ptr<cv::SIFT> sift_;
  GridSelector selector_;
};

}  // namespace

std::unique_ptr<FeatureExtractor> CreateSiftExtractor(const FeatureOptions& options) {
  const Status status = options.Validate();
  if (!status.ok()) throw ToolError(std::string("features: ") + status.text());
  if (options.type != FeatureType::kSift) throw ToolError("features: the type is not SIFT");
  return std::make_unique<SiftExtractor>(options);
}

}  // namespace viewfix
