// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>

#include "firmware_tools/mapping/colmap_convention.h"
#include "firmware_tools/mapping/colmap_records.h"

namespace viewfix {
namespace {

constexpr std::uint64_t kMaxSide = 1 << 20;  // pixels

// How a model's parameters are laid out: focal length(s), cx, cy, then the distortion.
struct Layout {
  ColmapCameraModel model;
  CameraModel ours;
  int num_focal;                  // 1: fx = fy
  std::array<int, 8> distortion;  // place in Camera::distortion of each parameter behind cy
};

constexpr std::array<Layout, 9> kLayouts = {{
    {{"SIMPLE_PINHOLE", 0, 3}, CameraModel::kPinhole, 1, {}},
    {{"PINHOLE", 1, 4}, CameraModel::kPinhole, 2, {}},
    {{"SIMPLE_RADIAL", 2, 4}, CameraModel::kBrownConrady, 1, {0}},
    {{"RADIAL", 3, 5}, CameraModel::kBrownConrady, 1, {0, 1}},
    {{"OPENCV", 4, 8}, CameraModel::kBrownConrady, 2, {0, 1, 2, 3}},
    {{"OPENCV_FISHEYE", 5, 8}, CameraModel::kKannalaBrandt, 2, {0, 1, 2, 3}},
    {{"FULL_OPENCV", 6, 12}, CameraModel::kBrownConrady, 2, {0, 1, 2, 3, 4, 5, 6, 7}},
    {{"SIMPLE_RADIAL_FISHEYE", 8, 4}, CameraModel::kKannalaBrandt, 1, {0}},
    {{"RADIAL_FISHEYE", 9, 5}, CameraModel::kKannalaBrandt, 1, {0, 1}},
}};

const Layout& LayoutOf(const ColmapCameraModel& model) {
  return *std::find_if(kLayouts.begin(), kLayouts.end(),
                       [&](const Layout& layout) { return layout.model.id == model.id; });
}

const char* ColmapNameOf(const Camera& camera) {
  switch (camera.model) {
    case CameraModel::kPinhole:
      return "PINHOLE";
    case CameraModel::kKannalaBrandt:
      return "OPENCV_FISHEYE";
    case CameraModel::kBrownConrady:
      break;
  }
  const bool is_short = std::all_of(camera.distortion.begin() + 4, camera.distortion.end(),
                                    [](double k) { return k == 0; });
  return is_short ? "OPENCV" : "FULL_OPENCV";
}

}  // namespace

const ColmapCameraModel* FindColmapCameraModel(std::string_view name) {
  for (const Layout& layout : kLayouts) {
    if (layout.model.name == name) return &layout.model;
  }
  return nullptr;
}

const ColmapCameraModel* FindColmapCameraModel(int id) {
  for (const Layout& layout : kLayouts) {
    if (layout.model.id == id) return &layout.model;
  }
  return nullptr;
}

bool CameraFromColmap(const ColmapCamera& from, Camera& camera, std::string& cause) {
  if (from.width < 1 || from.height < 1 || from.width > kMaxSide || from.height > kMaxSide) {
    cause = "its size is not that of an image";
    return false;
  }
  for (const double value : from.params) {
    if (std::isfinite(value)) continue;
    cause = "a parameter is not finite";
    return false;
  }
  const Layout& layout = LayoutOf(*from.model);
  camera = {layout.ours, static_cast<int>(from.width), static_cast<int>(from.height)};
  camera.fx = from.params[0];
  camera.fy = from.params[layout.num_focal - 1];
  const Eigen::Vector2d centre =
      FromColmapPixel({from.params[layout.num_focal], from.params[layout.num_focal + 1]});
  camera.cx = centre.x();
  camera.cy = centre.y();
  const int first = layout.num_focal + 2;
  for (int i = first; i < layout.model.num_params; ++i) {
    camera.distortion[layout.distortion[i - first]] = from.params[i];
  }
  cause = "a focal length is not positive";
  return camera.fx > 0 && camera.fy > 0;
}

ColmapCamera CameraToColmap(const Camera& camera, std::uint32_t id) {
  const ColmapCameraModel* model = FindColmapCameraModel(ColmapNameOf(camera));
  const Eigen::Vector2d centre = ToColmapPixel({camera.cx, camera.cy});
  ColmapCamera to{id,
                  model,
                  static_cast<std::uint64_t>(camera.width),
                  static_cast<std::uint64_t>(camera.height),
                  {camera.fx, camera.fy, centre.x(), centre.y()}};
  to.params.insert(to.params.end(), camera.distortion.begin(),
                   camera.distortion.begin() + (model->num_params - 4));
  return to;
}

}  // namespace viewfix
