// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/map_input.h"

#include <algorithm>

#include "firmware_tools/dataset/calibration_file.h"

namespace viewfix {
namespace {

constexpr double kNominalSide = 640;

int AddCamera(const Camera& camera, std::vector<Camera>& cameras) {
  const auto same = std::find(cameras.begin(), cameras.end(), camera);
  if (same != cameras.end()) return static_cast<int>(same - cameras.begin());
  cameras.push_back(camera);
  return static_cast<int>(cameras.size()) - 1;
}

}  // namespace

MapInput MakeMapInput(const ImageSet& set, const FeatureStore& features,
                      std::span<const int> image_idxs) {
  MapInput input;
  for (const int image_idx : image_idxs) {
    const ImageRecord& record = set.images[image_idx];
    const ImageFeatures& found = features.images[image_idx];
    if (found.keypoints.empty()) continue;
    if (record.camera_idx < 0) {
      throw ToolError(set.FullPath(record).string() + ": its camera is not known");
    }
    const Camera camera =
        ToCamera(set.cameras[record.camera_idx]).ResizedTo(found.width, found.height);
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
  return input;
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
