// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/model_export.h"

#include <algorithm>
#include <numeric>
#include <string>

#include "engine/pose/model_geometry.h"

namespace viewfix {
namespace {

namespace fs = std::filesystem;

Reconstruction PointsOf(const ModelView& model, int map_idx) {
  const ModelLandmarks& landmarks = model.landmarks();
  Reconstruction map;
  map.cameras = {CameraOf(model.camera())};
  const std::uint32_t begin = landmarks.map_begin[map_idx];
  const std::uint32_t end = landmarks.map_begin[std::size_t(map_idx) + 1];
  for (std::uint32_t l = begin; l < end; ++l) {
    map.points.emplace_back().position = LandmarkPosition(model, l);
  }
  return map;
}

std::string NameOf(const ModelView& model, int keyframe_idx) {
  const std::string_view name = model.keyframe_name(keyframe_idx);
  return name.empty() ? "keyframe-" + std::to_string(keyframe_idx) : std::string(name);
}

// As they were taken, where names tell: trajectories are read in this order.
std::vector<int> KeyframesByName(const ModelView& model) {
  std::vector<int> order(model.keyframes().size);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return model.keyframe_name(a) < model.keyframe_name(b); });
  return order;
}

MapImage ImageOf(const ModelView& model, int keyframe_idx) {
  const Rigid3 world_from_cam = KeyframePose(model.keyframes(), keyframe_idx);
  return {NameOf(model, keyframe_idx), 0, Inverse(world_from_cam), {}, {}};
}

// Puts an observation where the landmark must be seen.
void Observe(Reconstruction& map, int image_idx, int point_idx) {
  MapImage& image = map.images[image_idx];
  const Camera& camera = map.cameras[image.camera_idx];
  MapPoint& point = map.points[point_idx];
  Eigen::Vector2d pixel;
  const bool seen = camera.Project(image.cam_from_world * point.position, pixel) &&
                    pixel.x() > -0.5 && pixel.y() > -0.5 && pixel.x() < camera.width - 0.5 &&
                    pixel.y() < camera.height - 0.5;
  if (!seen) return;
  point.track.push_back({image_idx, static_cast<int>(image.keypoints.size())});
  image.keypoints.push_back(pixel);
  image.point_idx.push_back(point_idx);
}

fs::path PathOf(const fs::path& path, ExportFormat format, std::size_t map_idx) {
  const std::string number = std::to_string(map_idx);
  if (format == ExportFormat::kColmap) return path / number;
  fs::path numbered = path;
  numbered.replace_filename(path.stem().string().append("-").append(number) +
                            path.extension().string());
  return numbered;
}

}  // namespace

std::vector<Reconstruction> MapsOfModel(const ModelView& model) {
  const ModelKeyframes& keyframes = model.keyframes();
  const ModelLandmarks& landmarks = model.landmarks();
  std::vector<Reconstruction> maps;
  for (int m = 0; m < landmarks.num_maps; ++m) maps.push_back(PointsOf(model, m));
  if (maps.empty()) return maps;
  for (const int k : KeyframesByName(model)) {
    const std::uint32_t begin = keyframes.landmark_begin[k];
    const std::uint32_t end = keyframes.landmark_begin[std::size_t(k) + 1];
    if (keyframes.has_pose[k] == 0 || (begin == end && maps.size() > 1)) continue;
    const int m = begin == end ? 0 : model.MapOf(keyframes.landmarks[begin]);
    const int image_idx = static_cast<int>(maps[m].images.size());
    maps[m].images.push_back(ImageOf(model, k));
    for (std::uint32_t i = begin; i < end; ++i) {
      Observe(maps[m], image_idx,
              static_cast<int>(keyframes.landmarks[i] - landmarks.map_begin[m]));
    }
  }
  return maps;
}

std::vector<fs::path> ExportModel(const ModelView& model, ExportFormat format,
                                  const fs::path& path) {
  const std::vector<Reconstruction> maps = MapsOfModel(model);
  std::vector<fs::path> written;
  if (format == ExportFormat::kColmap && maps.size() > 1) {
    std::error_code ignored;  // Export() says what is wrong with the folders inside
    fs::create_directory(path, ignored);
  }
  for (std::size_t m = 0; m < maps.size(); ++m) {
    written.push_back(maps.size() == 1 ? path : PathOf(path, format, m));
    Export(maps[m], format, written.back());
  }
  return written;
}

}  // namespace viewfix
