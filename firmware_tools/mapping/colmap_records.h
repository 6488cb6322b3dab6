// SPDX-License-Identifier: BSD-3-Clause
// The records of COLMAP's files as they stand there: ids, pixel centres at +0.5. Private to the
// readers and writers of COLMAP models.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/geometry/camera.h"

namespace viewfix {

inline constexpr std::uint64_t kNoColmapPoint = std::numeric_limits<std::uint64_t>::max();

// A camera model of COLMAP's. Its numbers are written in files.
struct ColmapCameraModel {
  const char* name;
  int id;
  int num_params;
};

// Null: a model that Viewfix has no like of.
const ColmapCameraModel* FindColmapCameraModel(std::string_view name);
const ColmapCameraModel* FindColmapCameraModel(int id);

struct ColmapCamera {
  std::uint32_t id = 0;
  const ColmapCameraModel* model = nullptr;
  std::uint64_t width = 0, height = 0;
  std::vector<double> params;  // [model->num_params]
};

struct ColmapImage {
  std::uint32_t id = 0;
  Eigen::Quaterniond cam_from_world;  // as written: of any length
  Eigen::Vector3d translation;
  std::uint32_t camera_id = 0;
  std::string name;
  std::vector<Eigen::Vector2d> keypoints;
  std::vector<std::uint64_t> point_ids;  // [keypoints] kNoColmapPoint: none
};

struct ColmapPoint {
  std::uint64_t id = 0;
  Eigen::Vector3d position;
  double error_px = 0;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> track;  // image id, index of key point
};

struct ColmapRecords {
  std::vector<ColmapCamera> cameras;
  std::vector<ColmapImage> images;
  std::vector<ColmapPoint> points;
};

// Each throws ToolError naming the file, the place in it and the cause.
ColmapRecords ReadColmapText(const std::filesystem::path& folder);
ColmapRecords ReadColmapBinary(const std::filesystem::path& folder);
void WriteColmapText(const ColmapRecords& records, const std::filesystem::path& folder);
void WriteColmapBinary(const ColmapRecords& records, const std::filesystem::path& folder);

// The other model's camera; false: its parameters make no camera (`cause` says why).
bool CameraFromColmap(const ColmapCamera& from, Camera& camera, std::string& cause);
ColmapCamera CameraToColmap(const Camera& camera, std::uint32_t id);

}  // namespace viewfix
