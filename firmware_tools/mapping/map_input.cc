// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/map_input.h"

#include <algorithm>
#include <cstdlib>
#include <map>
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
  for (const int image_idx : image_idxs) {
    const ImageRecord& record = set.images[image_idx];
    const ImageFeatures& found = features.images[image_idx];
    if (found.keypoints.empty()) continue;
    const Camera camera = CameraOf(set, record, found, guesses);
    MapFrame frame{.name = record.path,
                   .capture = record.capture,
                   .camera_idx = AddCamera(camera, input.cameras),
                   .features = &found,
                   .cam_from_world = {}};
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
