// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/dataset/camera_calibration.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <set>

#include "engine/geometry/rigid3.h"
#include "firmware_tools/dataset/calibration_file.h"
#include "firmware_tools/dataset/image_loader.h"

namespace viewfix {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLeastCorners = 8;  // of a view
constexpr std::size_t kLeastViews = 6;
constexpr double kOutlierRatio = 2.5;  // of a view's residual to the median
constexpr double kOutlierFloorPx = 0.1;
constexpr int kMaxRounds = 4;
constexpr int kCellsX = 6, kCellsY = 4;
constexpr double kLeastCoverage = 0.5;
constexpr double kLeastTilt = 15 * CV_PI / 180;
constexpr double kMaxFocalSigma = 0.01;  // of the focal length
constexpr std::size_t kMaxFrames = 80;   // of a video
constexpr double kLeastMotion = 0.04;    // of the image's width, between kept frames of a video

void TakeImage(const YuvImage& image, const CharucoSpec& spec, const std::string& name,
               BoardViews& boards) {
  if (boards.images++ == 0) {
    boards.width = image.width;
    boards.height = image.height;
  }
  if (image.width != boards.width || image.height != boards.height) {
    throw ToolError("cannot calibrate with " + name + ": " + std::to_string(image.width) + " x " +
                    std::to_string(image.height) + " pixels, and the first image has " +
                    std::to_string(boards.width) + " x " + std::to_string(boards.height));
  }
  boards.views.push_back(FindBoard(image, spec, name));
}

BoardViews FindInImages(const fs::path& source, const CharucoSpec& spec, const Progress& report) {
  const ImageSet set = LoadImageSet(source);
  BoardViews boards;
  for (const ImageRecord& image : set.images) {
    TakeImage(LoadImage(set.FullPath(image)), spec, image.path, boards);
    if (report) report(boards.images, static_cast<int>(set.images.size()));
  }
  return boards;
}

// Mean motion of the corners that both views show, pixels; a huge number where they share none.
double Motion(const BoardView& a, const BoardView& b) {
  double sum = 0;
  int count = 0;
  for (std::size_t i = 0; i < a.corner_ids.size(); ++i) {
    const auto found = std::find(b.corner_ids.begin(), b.corner_ids.end(), a.corner_ids[i]);
    if (found == b.corner_ids.end()) continue;
    sum += (a.pixels[i] - b.pixels[found - b.corner_ids.begin()]).norm();
    ++count;
  }
  return count == 0 ? 1e9 : sum / count;
}

void KeepEvenly(std::vector<BoardView>& views, std::size_t most) {
  if (views.size() <= most) return;
  std::vector<BoardView> kept;
  for (std::size_t i = 0; i < most; ++i) kept.push_back(views[i * views.size() / most]);
  views = std::move(kept);
}

// By OpenCV's readers of files. Left to itself it asks the drivers of cameras too, V4L2 and
// libgphoto2, whether they know a file that none of these reads: which takes a second, touches what
// is plugged in, and leaks what libusb lists.
cv::VideoCapture OpenVideo(const fs::path& source) {
  for (const int reader : {cv::CAP_FFMPEG, cv::CAP_GSTREAMER, cv::CAP_OPENCV_MJPEG}) {
    cv::VideoCapture video(source.string(), reader);
    if (video.isOpened()) return video;
  }
  throw ToolError("cannot read video " + source.string());
}

BoardViews FindInVideo(const fs::path& source, const CharucoSpec& spec, const Progress& report) {
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);  // of each backend
  cv::VideoCapture video = OpenVideo(source);
  const int frames = static_cast<int>(video.get(cv::CAP_PROP_FRAME_COUNT));
  BoardViews boards;
  cv::Mat frame, grey;
  for (int i = 0; video.read(frame); ++i) {
    if (report) report(i, std::max(frames, i + 1));
    if (frame.channels() == 3) {
      cv::cvtColor(frame, grey, cv::COLOR_BGR2GRAY);
    } else {
      grey = frame.clone();
    }
    const YuvImage image{grey.cols, grey.rows, {grey.data, grey.data + grey.total()}};
    TakeImage(image, spec, std::string("frame ") += std::to_string(i), boards);
    const std::size_t count = boards.views.size();
    const bool is_still = count >= 2 && Motion(boards.views[count - 2], boards.views.back()) <
                                            kLeastMotion * boards.width;
    if (is_still || boards.views.back().corner_ids.size() < kLeastCorners) boards.views.pop_back();
  }
  if (boards.images == 0) throw ToolError("video " + source.string() + " has no frames");
  KeepEvenly(boards.views, kMaxFrames);
  return boards;
}

// The views in use, as OpenCV takes them, and what it makes of them.
class Calibrator {
 public:
  Calibrator(const BoardViews& boards, const CharucoSpec& spec, CameraModel model)
      : boards_(boards), corners_(BoardCorners(spec)), model_(model) {
    for (const BoardView& view : boards.views) {
      result_.views.push_back({view.name, static_cast<int>(view.corner_ids.size()), 0,
                               view.corner_ids.size() >= kLeastCorners && !IsOnALine(view)});
    }
  }

  CameraCalibration Run() {
    RefuseFewViews();
    RefuseThinCoverage();
    for (int round = 0; round < kMaxRounds; ++round) {
      Solve();
      MeasureViews();
      if (!DropOutliers()) break;
      RefuseFewViews();
    }
    RefuseAlikeBoards();
    if (result_.focal_sigma_share > kMaxFocalSigma) {
      throw ToolError("the focal length is uncertain by " + Percent(result_.focal_sigma_share) +
                      ": take more photographs, nearer and with the board tilted");
    }
    result_.calibration = ToCalibration(camera_);
    return std::move(result_);
  }

 private:
  static std::string Percent(double share) {
    char text[16];
    std::snprintf(text, sizeof text, "%.1f %%", 100 * share);
    return text;
  }

  bool IsOnALine(const BoardView& view) const {
    std::set<double> xs, ys;
    for (const int id : view.corner_ids) {
      xs.insert(corners_[id].x());
      ys.insert(corners_[id].y());
    }
    return xs.size() < 2 || ys.size() < 2;
  }

  std::vector<std::size_t> Used() const {
    std::vector<std::size_t> used;
    for (std::size_t i = 0; i < result_.views.size(); ++i) {
      if (result_.views[i].is_used) used.push_back(i);
    }
    return used;
  }

  void RefuseFewViews() const {
    const std::size_t used = Used().size();
    if (used >= kLeastViews) return;
    throw ToolError("the board is usable in " + std::to_string(used) + " of " +
                    std::to_string(boards_.images) + " images, and " + std::to_string(kLeastViews) +
                    " are needed: the whole board sharp, or most of it");
  }

  void RefuseThinCoverage() {
    std::set<int> cells;
    for (const std::size_t i : Used()) {
      for (const Eigen::Vector2d& pixel : boards_.views[i].pixels) {
        const int x = std::clamp(int(pixel.x() * kCellsX / boards_.width), 0, kCellsX - 1);
        const int y = std::clamp(int(pixel.y() * kCellsY / boards_.height), 0, kCellsY - 1);
        cells.insert(y * kCellsX + x);
      }
    }
    result_.coverage = static_cast<double>(cells.size()) / (kCellsX * kCellsY);
    if (result_.coverage >= kLeastCoverage) return;
    throw ToolError("the board covers " + Percent(result_.coverage) +
                    " of the picture: hold it into the corners and edges too");
  }

  void Solve() try {
    std::vector<std::vector<cv::Point3d>> on_board;
    std::vector<std::vector<cv::Point2d>> in_image;
    for (const std::size_t i : Used()) {
      const BoardView& view = boards_.views[i];
      auto& points = on_board.emplace_back();
      auto& pixels = in_image.emplace_back();
      for (std::size_t k = 0; k < view.corner_ids.size(); ++k) {
        const Eigen::Vector3d& corner = corners_[view.corner_ids[k]];
        points.emplace_back(corner.x(), corner.y(), corner.z());
        pixels.emplace_back(view.pixels[k].x(), view.pixels[k].y());
      }
    }
    cv::Mat k = cv::Mat::eye(3, 3, CV_64F), distortion;
    if (model_ == CameraModel::kKannalaBrandt) {
      SolveFisheye(on_board, in_image, k, distortion);
    } else {
      SolveBrown(on_board, in_image, k, distortion);
    }
    camera_ = {model_,
               boards_.width,
               boards_.height,
               k.at<double>(0, 0),
               k.at<double>(1, 1),
               k.at<double>(0, 2),
               k.at<double>(1, 2),
               {}};
    const std::size_t count = std::min(distortion.total(), camera_.distortion.size());
    std::copy_n(distortion.ptr<double>(), count, camera_.distortion.begin());
    if (!camera_.Validate().ok()) throw ToolError("the calibration does not converge");
  } catch (const cv::Exception&) {  // its text is about OpenCV's own source
    throw ToolError("the calibration does not converge: other photographs, or the other --model");
  }

  void SolveFisheye(const std::vector<std::vector<cv::Point3d>>& on_board,
                    const std::vector<std::vector<cv::Point2d>>& in_image, cv::Mat& k,
                    cv::Mat& distortion) {
    const int flags = cv::fisheye::CALIB_RECOMPUTE_EXTRINSIC | cv::fisheye::CALIB_FIX_SKEW;
    cv::fisheye::calibrate(on_board, in_image, {boards_.width, boards_.height}, k, distortion,
                           rotations_, translations_, flags);
    result_.focal_sigma_share = 0;  // cv::fisheye does not tell
  }

  void SolveBrown(const std::vector<std::vector<cv::Point3d>>& on_board,
                  const std::vector<std::vector<cv::Point2d>>& in_image, cv::Mat& k,
                  cv::Mat& distortion) {
    std::vector<std::vector<cv::Point3f>> points;
    std::vector<std::vector<cv::Point2f>> pixels;
    for (const auto& view : on_board) points.emplace_back(view.begin(), view.end());
    for (const auto& view : in_image) pixels.emplace_back(view.begin(), view.end());
    cv::Mat sigmas, extrinsic_sigmas, view_errors;
    cv::calibrateCamera(points, pixels, {boards_.width, boards_.height}, k, distortion, rotations_,
                        translations_, sigmas, extrinsic_sigmas, view_errors);
    result_.focal_sigma_share = sigmas.at<double>(0) / k.at<double>(0, 0);
  }

  Rigid3 CamFromBoard(std::size_t used_idx) const {
    const Eigen::Map<const Eigen::Vector3d> rotation(rotations_[used_idx].val);
    const Eigen::Map<const Eigen::Vector3d> translation(translations_[used_idx].val);
    const double angle = rotation.norm();
    const Eigen::Vector3d axis =
        angle > 0 ? Eigen::Vector3d(rotation / angle) : Eigen::Vector3d::UnitX();
    return {Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis)), translation};
  }

  // Residuals by the camera that will be used, not by OpenCV's: the two must agree.
  void MeasureViews() {
    const std::vector<std::size_t> used = Used();
    double all = 0;
    std::size_t count = 0;
    for (std::size_t u = 0; u < used.size(); ++u) {
      const BoardView& view = boards_.views[used[u]];
      double sum = 0;
      for (std::size_t k = 0; k < view.pixels.size(); ++k) {
        Eigen::Vector2d pixel(0, 0);
        const bool seen = camera_.Project(CamFromBoard(u) * corners_[view.corner_ids[k]], pixel);
        sum += seen ? (pixel - view.pixels[k]).squaredNorm() : boards_.width * boards_.width;
      }
      const auto corners = static_cast<double>(view.pixels.size());
      result_.views[used[u]].rms_px = std::sqrt(sum / corners);
      all += sum;
      count += view.pixels.size();
    }
    result_.rms_px = std::sqrt(all / static_cast<double>(count));
  }

  bool DropOutliers() {
    std::vector<double> rms;
    for (const std::size_t i : Used()) rms.push_back(result_.views[i].rms_px);
    std::nth_element(rms.begin(), rms.begin() + std::ptrdiff_t(rms.size() / 2), rms.end());
    const double limit = std::max(kOutlierRatio * rms[rms.size() / 2], kOutlierFloorPx);
    bool dropped = false;
    for (const std::size_t i : Used()) {
      if (result_.views[i].rms_px <= limit) continue;
      result_.views[i].is_used = false;
      result_.views[i].rms_px = 0;
      dropped = true;
    }
    return dropped;
  }

  // Planes that are all parallel leave the focal length to the distance.
  void RefuseAlikeBoards() const {
    double widest = 0;
    for (std::size_t a = 0; a < rotations_.size(); ++a) {
      for (std::size_t b = 0; b < a; ++b) {
        const Eigen::Vector3d normal_a = CamFromBoard(a).rotation * Eigen::Vector3d::UnitZ();
        const Eigen::Vector3d normal_b = CamFromBoard(b).rotation * Eigen::Vector3d::UnitZ();
        widest = std::max(widest, std::acos(std::clamp(normal_a.dot(normal_b), -1.0, 1.0)));
      }
    }
    if (widest >= kLeastTilt) return;
    throw ToolError(
        "the board was held at the same tilt in all images: tilt it by 30 degrees or more");
  }

  const BoardViews& boards_;
  std::vector<Eigen::Vector3d> corners_;
  CameraModel model_;
  Camera camera_;
  std::vector<cv::Vec3d> rotations_, translations_;  // [views in use]
  CameraCalibration result_;
};

}  // namespace

BoardViews FindBoards(const fs::path& source, const CharucoSpec& spec, const Progress& report) {
  CheckSpec(spec);
  if (!fs::exists(source)) throw ToolError("no such file or folder: " + source.string());
  const bool is_set = fs::is_directory(source) || source.extension() == ".csv";
  return is_set ? FindInImages(source, spec, report) : FindInVideo(source, spec, report);
}

CameraCalibration CalibrateCamera(const BoardViews& boards, const CharucoSpec& spec,
                                  CameraModel model) {
  return Calibrator(boards, spec, model).Run();
}

}  // namespace viewfix
