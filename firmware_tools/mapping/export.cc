// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/export.h"

#include <algorithm>
#include <charconv>
#include <string>
#include <vector>

#include "firmware_tools/dataset/text_fields.h"
#include "firmware_tools/dataset/tool_file.h"
#include "firmware_tools/mapping/colmap_model.h"

namespace viewfix {
namespace {

namespace fs = std::filesystem;

std::string PlyBytes(const std::vector<Eigen::Vector3d>& points) {
  std::string bytes = "ply\nformat binary_little_endian 1.0\nelement vertex ";
  bytes += std::to_string(points.size());
  bytes += "\nproperty double x\nproperty double y\nproperty double z\nend_header\n";
  for (const Eigen::Vector3d& point : points) {
    bytes.append(reinterpret_cast<const char*>(point.data()), 3 * sizeof(double));
  }
  return bytes;
}

void ExportPly(const Reconstruction& map, const fs::path& path) {
  std::vector<Eigen::Vector3d> points, centres;
  for (const MapPoint& point : map.points) points.push_back(point.position);
  for (const MapImage& image : map.images) {
    centres.push_back(Inverse(image.cam_from_world).translation);
  }
  WriteTextFile(path, PlyBytes(points));
  fs::path beside = path;
  beside.replace_filename(path.stem().string() + "-cameras.ply");
  WriteTextFile(beside, PlyBytes(centres));
}

std::string StemOf(const MapImage& image) { return fs::path(image.name).stem().string(); }

bool IsNumber(const std::string& text) {
  double value = 0;
  const auto [end, error] =
      std::from_chars(text.data(), text.data() + text.size(), value, std::chars_format::fixed);
  return error == std::errc() && end == text.data() + text.size();
}

void ExportTum(const Reconstruction& map, const fs::path& path) {
  const bool has_times = std::all_of(map.images.begin(), map.images.end(),
                                     [](const MapImage& image) { return IsNumber(StemOf(image)); });
  std::string text = "# timestamp tx ty tz qx qy qz qw\n";
  for (std::size_t i = 0; i < map.images.size(); ++i) {
    const Rigid3 world_from_cam = Inverse(map.images[i].cam_from_world);
    text += has_times ? StemOf(map.images[i]) : std::to_string(i);
    for (const double value : world_from_cam.translation)
      text.append(" ").append(ExactNumber(value));
    for (const double value : world_from_cam.rotation.coeffs()) {
      text.append(" ").append(ExactNumber(value));
    }
    text += '\n';
  }
  WriteTextFile(path, text);
}

bool HasBlankInName(const MapImage& image) {
  return image.name.find_first_of(" \t\r\n\v\f") != std::string::npos;
}

}  // namespace

void Export(const Reconstruction& map, ExportFormat format, const fs::path& path) {
  switch (format) {
    case ExportFormat::kColmap: {
      const bool needs_binary = std::any_of(map.images.begin(), map.images.end(), HasBlankInName);
      WriteColmapModel(map, path, needs_binary ? ColmapFormat::kBinary : ColmapFormat::kText);
      return;
    }
    case ExportFormat::kPly:
      ExportPly(map, path);
      return;
    case ExportFormat::kTum:
      ExportTum(map, path);
      return;
  }
}

}  // namespace viewfix
