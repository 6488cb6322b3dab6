// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/map_input.h"

#include <algorithm>

#include "firmware_tools/dataset/tool_file.h"

namespace viewfix {
namespace {

constexpr double kNominalSide = 640;

Camera ToCamera(const Calibration& calibration, const std::string& image) {
  Camera camera{.width = calibration.width,
                .height = calibration.height,
                .fx = calibration.fx,
                .fy = calibration.fy,
                .cx = calibration.cx,
                .cy = calibration.cy};
  const auto& distortion = calibration.distortion;
  const auto is_set = [](double coefficient) { return coefficient != 0; };
  const auto used = std::find_if(distortion.rbegin(), distortion.rend(), is_set).base();
  const auto count = static_cast<std::size_t>(used - distortion.begin());
  if (count > camera.distortion.size()) {
    throw ToolError(image + ": its calibration has thin prism distortion, which is not supported");
  }
  const bool is_plain = calibration.model == CameraModel::kBrownConrady && count == 0;
  camera.model = is_plain ? CameraModel::kPinhole : calibration.model;
  std::copy_n(distortion.begin(), count, camera.distortion.begin());
  if (const Status status = camera.Validate(); !status.ok()) {
    throw ToolError(image + ": " + Describe(status));
  }
  return camera;
}

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
    const Camera camera = ToCamera(set.cameras[record.camera_idx], set.FullPath(record).string())
                              .ResizedTo(found.width, found.height);
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
