// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/map_input.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <numeric>
#include <string>

#include "firmware_tools/dataset/calibration_file.h"

namespace viewfix {
namespace {

constexpr double kNominalSide = 640;
constexpr double kGuessedFocal = 1.2;  // longer sides

int AddCamera(const Camera& camera, std::vector<Camera>& cameras) {
  const auto same = std::find(cameras.begin(), cameras.end(), camera);
  if (same != cameras.end()) return static_cast<int>(same - cameras.begin());
  cameras.push_back(camera);
  return static_cast<int>(cameras.size()) - 1;
}

struct Guesses {
  int by_exif = 0;
  int blind = 0;
};

// At the size that features were found in.
Camera CameraOf(const ImageSet& set, const ImageRecord& image, const ImageFeatures& found,
                Guesses& guesses) {
  const auto known = CalibrationOf(set, image, found.exif, found.width, found.height);
  if (known) {
    guesses.by_exif += image.camera_idx < 0 ? 1 : 0;
    return ToCamera(*known).ResizedTo(found.width, found.height);
  }
  ++guesses.blind;
  Camera camera;
  camera.width = found.width;
  camera.height = found.height;
  camera.fx = camera.fy = kGuessedFocal * std::max(found.width, found.height);
  camera.cx = 0.5 * (found.width - 1);
  camera.cy = 0.5 * (found.height - 1);
  return camera;
}

// The number that a file's name ends in. None: it ends in none, or in one that is no number.
std::optional<double> NumberOf(const std::string& path) {
  const std::string stem = std::filesystem::path(path).stem().string();
  const std::size_t begin = stem.find_last_not_of("0123456789") + 1;
  if (begin == stem.size() || stem.size() - begin > 15) return std::nullopt;
  return std::stod(stem.substr(begin));
}

// Of the images of one walk, in units of the median step: the numbers in their names where those
// ascend (a set may hold every third frame, or name them by time), else their order.
std::vector<double> TimesOfWalk(const ImageSet& set, std::span<const int> images) {
  std::vector<double> times, steps;
  for (const int i : images) {
    const auto number = NumberOf(set.images[i].path);
    if (!number || (!times.empty() && *number <= times.back())) break;
    if (!times.empty()) steps.push_back(*number - times.back());
    times.push_back(*number);
  }
  if (times.size() < images.size() || steps.empty()) {
    times.resize(images.size());
    std::iota(times.begin(), times.end(), 0.0);
    return times;
  }
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  for (double& time : times) time /= *middle;
  return times;
}

// [images] in their walks.
std::vector<double> TimesOf(const ImageSet& set) {
  std::map<std::string, std::vector<int>> walks;
  for (int i = 0; i < static_cast<int>(set.images.size()); ++i) {
    walks[set.images[i].capture].push_back(i);
  }
  std::vector<double> times(set.images.size());
  for (const auto& [capture, images] : walks) {
    const std::vector<double> of_walk = TimesOfWalk(set, images);
    for (std::size_t i = 0; i < images.size(); ++i) times[images[i]] = of_walk[i];
  }
  return times;
}

std::string CountOf(int images, const char* what) {
  std::string text = std::to_string(images);
  return text.append(images == 1 ? " image" : " images").append(what);
}

void TellGuesses(const Guesses& guesses, MapInput& input) {
  input.focal_is_guess = guesses.by_exif + guesses.blind > 0;
  if (guesses.by_exif > 0) {
    input.warnings.push_back(CountOf(guesses.by_exif,
                                     " without a calibration: EXIF's focal "
                                     "length is the first guess"));
  }
  if (guesses.blind > 0) {
    input.warnings.push_back(CountOf(guesses.blind,
                                     " without a calibration or EXIF: the camera "
                                     "is guessed; `viewfix calibrate` makes the "
                                     "map better"));
  }
}

}  // namespace

MapInput MakeMapInput(const ImageSet& set, const FeatureStore& features,
                      std::span<const int> image_idxs) {
  MapInput input;
  Guesses guesses;
  const std::vector<double> times = TimesOf(set);
  for (const int image_idx : image_idxs) {
    const ImageRecord& record = set.images[image_idx];
    const ImageFeatures& found = features.images[image_idx];
    if (found.keypoints.empty()) continue;
    const Camera camera = CameraOf(set, record, found, guesses);
    MapFrame frame{.name = record.path,
                   .capture = record.capture,
                   .time = times[image_idx],
                   .camera_idx = AddCamera(camera, input.cameras),
                   .features = &found,
                   .cam_from_world = {},
                   .readout = 0};
    if (record.pose) {
      frame.cam_from_world = Inverse({record.pose->world_from_cam, record.pose->cam_in_world});
    }
    input.frames.push_back(std::move(frame));
  }
  TellGuesses(guesses, input);
  return input;
}

CaptureOrder::CaptureOrder(const MapInput& input) : input_(input) {
  std::map<std::string, int> count;
  for (const MapFrame& frame : input.frames) position_.push_back(count[frame.capture]++);
}

bool CaptureOrder::AreApart(int a, int b, int window) const {
  return input_.frames[a].capture != input_.frames[b].capture ||
         std::abs(position_[a] - position_[b]) > window;
}

double PixelsPerNominal(const Camera& camera) {
  return std::max(camera.width, camera.height) / kNominalSide;
}

std::vector<Eigen::Vector3d> Bearings(const Camera& camera, const ImageFeatures& features) {
  std::vector<Eigen::Vector3d> bearings(features.keypoints.size());
  for (std::size_t i = 0; i < bearings.size(); ++i) {
    if (!camera.Unproject(Pixel(features.keypoints[i]), bearings[i])) bearings[i].setZero();
  }
  return bearings;
}

}  // namespace viewfix
