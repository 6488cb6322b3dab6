// SPDX-License-Identifier: BSD-3-Clause
#include "tests/bench/feature_study.h"

#include <dlib/array2d.h>
#include <dlib/image_keypoint.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "engine/features/feature_extractor.h"

namespace viewfix {
namespace {

bool Inside(double x, double y, const cv::Mat& image) {
  return x >= 0 && y >= 0 && x <= image.cols - 1 && y <= image.rows - 1;
}

class ViewfixSurf final : public StudyMethod {
 public:
  explicit ViewfixSurf(bool upright) : upright_(upright) {}
  std::string name() const override { return upright_ ? "viewfix upright" : "viewfix"; }

  StudyFeatures Extract(const cv::Mat& grey, int count) const override {
    FeatureOptions options;
    options.max_image_side = kStudyMaxSide;
    options.max_features = count;
    options.upright = upright_;
    const auto extractor = CreateFeatureExtractor(options);
    FeatureSet found(options.max_features, (*extractor)->descriptor_dim());
    const ImageView view{grey.data, grey.cols, grey.rows, static_cast<std::ptrdiff_t>(grey.step)};
    if (!(*extractor)->Extract(view, found).ok()) return {};
    StudyFeatures features;
    features.keypoints.assign(found.keypoints().begin(), found.keypoints().end());
    features.descriptors.create(found.size(), found.dim(), CV_32F);
    for (int i = 0; i < found.size(); ++i) {
      std::ranges::copy(found.descriptor(i), features.descriptors.ptr<float>(i));
    }
    return features;
  }

 private:
  bool upright_;
};

class DlibSurf final : public StudyMethod {
 public:
  explicit DlibSurf(int first_step) : first_step_(first_step) {}
  std::string name() const override { return "dlib step " + std::to_string(first_step_); }

  StudyFeatures Extract(const cv::Mat& grey, int count) const override {
    constexpr int kBorder = 160;
    cv::Mat padded;
    cv::copyMakeBorder(grey, padded, kBorder, kBorder, kBorder, kBorder, cv::BORDER_REFLECT);
    dlib::array2d<unsigned char> image(padded.rows, padded.cols);
    for (int y = 0; y < padded.rows; ++y) std::memcpy(&image[y][0], padded.ptr(y), padded.cols);
    dlib::integral_image integral;
    integral.load(image);
    dlib::hessian_pyramid pyramid;
    pyramid.build_pyramid(integral, 4, 6, first_step_);
    std::vector<dlib::interest_point> found;
    dlib::get_interest_points(pyramid, 0.5, found);

    std::ranges::stable_sort(found, [](const auto& a, const auto& b) { return a.score > b.score; });
    StudyFeatures features;
    for (const dlib::interest_point& point : found) {
      if (static_cast<int>(features.keypoints.size()) == count) break;
      const auto reach = static_cast<unsigned long>(32 * point.scale);
      if (!get_rect(integral).contains(dlib::centered_rect(point.center, reach, reach))) continue;
      Keypoint keypoint;
      keypoint.x = static_cast<float>(point.center.x()) - kBorder;
      keypoint.y = static_cast<float>(point.center.y()) - kBorder;
      if (!Inside(keypoint.x, keypoint.y, grey)) continue;
      keypoint.sigma = static_cast<float>(point.scale);
      keypoint.response = static_cast<float>(point.score);
      features.keypoints.push_back(keypoint);
      const double angle = dlib::compute_dominant_angle(integral, point.center, point.scale);
      dlib::matrix<double, 64, 1> values;
      dlib::compute_surf_descriptor(integral, point.center, point.scale, angle, values);
      cv::Mat row(1, 64, CV_32F);
      for (int d = 0; d < 64; ++d) row.at<float>(d) = static_cast<float>(values(d));
      features.descriptors.push_back(row);
    }
    return features;
  }

 private:
  int first_step_;
};

class OpenCvSift final : public StudyMethod {
 public:
  std::string name() const override { return "opencv sift"; }

  StudyFeatures Extract(const cv::Mat& grey, int count) const override {
    const auto sift = cv::SIFT::create(count, 3, 0.005);
    std::vector<cv::KeyPoint> found;
    StudyFeatures features;
    sift->detectAndCompute(grey, cv::noArray(), found, features.descriptors);
    for (const cv::KeyPoint& point : found) {
      Keypoint keypoint;
      keypoint.x = point.pt.x;
      keypoint.y = point.pt.y;
      keypoint.sigma = point.size / 2;
      keypoint.response = point.response;
      features.keypoints.push_back(keypoint);
    }
    return features;
  }
};

cv::Mat Window(const cv::Mat& grey) {
  const int shorter = std::min(grey.cols, grey.rows);
  const cv::Size size(shorter * 4 / 5, shorter * 3 / 5);
  return grey(cv::Rect({(grey.cols - size.width) / 2, (grey.rows - size.height) / 2}, size));
}

StudyChange Rotate(const cv::Mat& grey, double angle_deg) {
  const cv::Mat before = Window(grey).clone();
  const cv::Point2d offset((grey.cols - before.cols) / 2, (grey.rows - before.rows) / 2);
  const cv::Point2d middle((before.cols - 1) / 2.0, (before.rows - 1) / 2.0);
  const double c = std::cos(angle_deg * CV_PI / 180);
  const double s = std::sin(angle_deg * CV_PI / 180);
  const cv::Matx33d turn(c, -s, middle.x - c * middle.x + s * middle.y,  //
                         s, c, middle.y - s * middle.x - c * middle.y,   //
                         0, 0, 1);
  const cv::Matx33d before_from_grey(1, 0, -offset.x, 0, 1, -offset.y, 0, 0, 1);
  const cv::Matx33d after_from_grey = turn * before_from_grey;
  cv::Mat after;
  cv::warpPerspective(grey, after, after_from_grey, before.size(), cv::INTER_CUBIC,
                      cv::BORDER_REFLECT);
  return {"rotation", std::to_string(static_cast<int>(angle_deg)) + " deg", before, after, turn};
}

StudyChange Shrink(const cv::Mat& before, double factor) {
  const cv::Size size(cvRound(before.cols * factor), cvRound(before.rows * factor));
  cv::Mat after;
  cv::resize(before, after, size, 0, 0, cv::INTER_AREA);
  const double sx = double(size.width) / before.cols;
  const double sy = double(size.height) / before.rows;
  return {"scale", "x " + std::to_string(factor).substr(0, 4), before, after,
          cv::Matx33d(sx, 0, sx / 2 - 0.5, 0, sy, sy / 2 - 0.5, 0, 0, 1)};
}

StudyChange Blur(const cv::Mat& before, double sigma) {
  cv::Mat after;
  cv::GaussianBlur(before, after, {}, sigma);
  return {"blur", "sigma " + std::to_string(sigma).substr(0, 3), before, after, cv::Matx33d::eye()};
}

StudyChange Light(const cv::Mat& before, double gain, double offset) {
  cv::Mat after;
  before.convertTo(after, CV_8U, gain, offset);
  return {"light", std::to_string(gain).substr(0, 4) + " v + " + std::to_string(int(offset)),
          before, after, cv::Matx33d::eye()};
}

// A lamp on one side: from half to full brightness, with a gamma of 0.7.
StudyChange SideLight(const cv::Mat& before) {
  cv::Mat after(before.size(), CV_8U);
  for (int y = 0; y < before.rows; ++y) {
    for (int x = 0; x < before.cols; ++x) {
      const double lamp = 0.5 + 0.5 * x / before.cols;
      const double value = std::pow(before.at<std::uint8_t>(y, x) / 255.0, 0.7);
      after.at<std::uint8_t>(y, x) = cv::saturate_cast<std::uint8_t>(255 * lamp * value);
    }
  }
  return {"light", "side, gamma", before, after, cv::Matx33d::eye()};
}

StudyChange Jpeg(const cv::Mat& before, int quality) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", before, bytes, {cv::IMWRITE_JPEG_QUALITY, quality});
  return {"jpeg", "quality " + std::to_string(quality), before,
          cv::imdecode(bytes, cv::IMREAD_GRAYSCALE), cv::Matx33d::eye()};
}

cv::Point2d Map(const cv::Matx33d& h, const Keypoint& keypoint) {
  const cv::Vec3d q = h * cv::Vec3d(keypoint.x, keypoint.y, 1);
  return {q[0] / q[2], q[1] / q[2]};
}

double Distance(const Keypoint& keypoint, cv::Point2d point) {
  return std::hypot(keypoint.x - point.x, keypoint.y - point.y);
}

// The features of `image` that `other`, reached by other_from_image, shows as well.
StudyFeatures SharedFeatures(const StudyFeatures& all, const cv::Mat& other,
                             const cv::Matx33d& other_from_image) {
  StudyFeatures shared;
  for (std::size_t i = 0; i < all.keypoints.size(); ++i) {
    const cv::Point2d p = Map(other_from_image, all.keypoints[i]);
    if (!Inside(p.x, p.y, other)) continue;
    shared.keypoints.push_back(all.keypoints[i]);
    shared.descriptors.push_back(all.descriptors.row(static_cast<int>(i)));
  }
  return shared;
}

}  // namespace

std::unique_ptr<StudyMethod> MakeViewfixSurf(bool upright) {
  return std::make_unique<ViewfixSurf>(upright);
}
std::unique_ptr<StudyMethod> MakeDlibSurf(int first_step) {
  return std::make_unique<DlibSurf>(first_step);
}
std::unique_ptr<StudyMethod> MakeOpenCvSift() { return std::make_unique<OpenCvSift>(); }

std::vector<StudyChange> MakeChanges(const cv::Mat& grey) {
  std::vector<StudyChange> changes;
  for (const double angle_deg : {5, 15, 30, 45, 60, 90, 135, 180}) {
    changes.push_back(Rotate(grey, angle_deg));
  }
  const cv::Mat before = Window(grey).clone();
  for (const double factor : {0.9, 0.75, 0.6, 0.5}) changes.push_back(Shrink(before, factor));
  for (const double sigma : {1.0, 1.5, 2.0, 3.0}) changes.push_back(Blur(before, sigma));
  changes.push_back(Light(before, 0.6, 0));
  changes.push_back(Light(before, 1.3, 10));
  changes.push_back(SideLight(before));
  for (const int quality : {50, 20, 10}) changes.push_back(Jpeg(before, quality));
  return changes;
}

cv::Mat RenderStudyImage(int width, int height, unsigned seed) {
  constexpr int kFine = 4;  // rendered larger and shrunk: antialiased
  cv::RNG random(seed);
  cv::Mat image(height * kFine, width * kFine, CV_8U, cv::Scalar(random.uniform(90, 160)));
  const auto anywhere = [&] {
    return cv::Point(random.uniform(0, image.cols), random.uniform(0, image.rows));
  };
  for (int i = 0; i < 900; ++i) {
    // Many small things, few large ones, the large ones first.
    const double size = 4 * kFine * std::pow(30.0, 1 - i / 900.0);
    const cv::Scalar grey(random.uniform(0, 256));
    const cv::Point p = anywhere();
    const int extent = std::max(2, cvRound(size * random.uniform(0.4, 1.0)));
    const int kind = random.uniform(0, 4);
    if (kind == 0) {
      cv::circle(image, p, extent / 2, grey, cv::FILLED);
    } else if (kind == 1) {
      const cv::RotatedRect box(p, cv::Size2f(float(extent), float(size) / 2),
                                random.uniform(0.F, 180.F));
      std::array<cv::Point2f, 4> corners;
      box.points(corners.data());
      std::array<cv::Point, 4> rounded;
      std::ranges::copy(corners, rounded.begin());
      cv::fillConvexPoly(image, rounded.data(), 4, grey);
    } else if (kind == 2) {
      cv::ellipse(image, p, {extent, extent / 2}, random.uniform(0, 360), 0, 270, grey,
                  std::max(2, extent / 5));
    } else {
      const char letter[] = {static_cast<char>('A' + random.uniform(0, 26)), 0};
      cv::putText(image, letter, p, cv::FONT_HERSHEY_SIMPLEX, extent / 20.0, grey,
                  std::max(2, extent / 10));
    }
  }
  cv::Mat small;
  cv::resize(image, small, {width, height}, 0, 0, cv::INTER_AREA);
  return small;
}

StudyScore Score(const StudyMethod& method, const StudyChange& change, int count) {
  constexpr double kNear = 2;        // pixels of `after`
  constexpr double kRightMatch = 4;  // pixels of `after`
  constexpr double kScaleRatio = 1.4;
  const cv::Matx33d& h = change.after_from_before;
  const StudyFeatures first = SharedFeatures(method.Extract(change.before, count), change.after, h);
  const StudyFeatures second =
      SharedFeatures(method.Extract(change.after, count), change.before, h.inv());
  if (first.keypoints.empty() || second.keypoints.empty()) return {};
  const double zoom = std::sqrt(std::fabs(h(0, 0) * h(1, 1) - h(0, 1) * h(1, 0)));

  int repeated = 0;
  int matched = 0;
  std::vector<bool> taken(second.keypoints.size(), false);
  for (std::size_t i = 0; i < first.keypoints.size(); ++i) {
    const cv::Point2d truth = Map(h, first.keypoints[i]);
    const double sigma = first.keypoints[i].sigma * zoom;
    int nearest = -1;
    double nearest_distance = kNear;
    int best = -1;
    double best_distance = INFINITY;
    for (std::size_t j = 0; j < second.keypoints.size(); ++j) {
      const Keypoint& candidate = second.keypoints[j];
      const double distance = Distance(candidate, truth);
      const double ratio = std::max(candidate.sigma / sigma, sigma / candidate.sigma);
      if (!taken[j] && distance < nearest_distance && ratio < kScaleRatio) {
        nearest = static_cast<int>(j);
        nearest_distance = distance;
      }
      const double descriptor_distance =
          cv::norm(first.descriptors.row(int(i)), second.descriptors.row(int(j)), cv::NORM_L2SQR);
      if (descriptor_distance < best_distance) {
        best = static_cast<int>(j);
        best_distance = descriptor_distance;
      }
    }
    if (nearest >= 0) taken[nearest] = true;
    if (nearest >= 0) ++repeated;
    if (Distance(second.keypoints[best], truth) < kRightMatch) ++matched;
  }
  const auto fewer = static_cast<double>(std::min(first.keypoints.size(), second.keypoints.size()));
  return {repeated / fewer, matched / static_cast<double>(first.keypoints.size()), fewer};
}

}  // namespace viewfix
