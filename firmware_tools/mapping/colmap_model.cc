// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/colmap_model.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <unordered_map>

#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/mapping/colmap_convention.h"
#include "firmware_tools/mapping/colmap_records.h"

namespace viewfix {
namespace {

namespace fs = std::filesystem;

constexpr const char* kParts[] = {"cameras", "images", "points3D"};
constexpr double kLeastQuaternionLength = 1e-6;
constexpr double kRoundingOfUnitLength = 1e-12;  // below it a quaternion is kept to the bit

const char* ExtensionOf(ColmapFormat format) {
  return format == ColmapFormat::kText ? ".txt" : ".bin";
}

bool HasModel(const fs::path& folder, ColmapFormat format) {
  return std::all_of(std::begin(kParts), std::end(kParts), [&](const std::string& part) {
    std::error_code error;
    return fs::is_regular_file(folder / (part + ExtensionOf(format)), error);
  });
}

// Turns records, whose ids are arbitrary, into a Reconstruction of indices.
class Assembler {
 public:
  Assembler(const fs::path& folder, const char* extension, ColmapRecords records)
      : folder_(folder), extension_(extension), records_(std::move(records)) {}

  Reconstruction Assemble() {
    SortById(records_.cameras, "cameras", "camera");
    SortById(records_.images, "images", "image");
    SortById(records_.points, "points3D", "point");
    AddCameras();
    AddImages();
    AddPoints();
    CheckKeypoints();
    return std::move(map_);
  }

 private:
  [[noreturn]] void Fail(const std::string& part, const std::string& cause) const {
    throw ToolError((folder_ / (part + extension_)).string() + ": " + cause);
  }

  template <typename Record>
  void SortById(std::vector<Record>& records, const char* part, const char* what) const {
    std::stable_sort(records.begin(), records.end(),
                     [](const Record& a, const Record& b) { return a.id < b.id; });
    const auto twin =
        std::adjacent_find(records.begin(), records.end(),
                           [](const Record& a, const Record& b) { return a.id == b.id; });
    if (twin == records.end()) return;
    Fail(part, std::string(what) + " " + std::to_string(twin->id) + " stands there twice");
  }

  void AddCameras() {
    for (const ColmapCamera& from : records_.cameras) {
      camera_idx_[from.id] = static_cast<int>(map_.cameras.size());
      std::string cause;
      if (!CameraFromColmap(from, map_.cameras.emplace_back(), cause)) {
        Fail("cameras", "camera " + std::to_string(from.id) + ": " + cause);
      }
    }
  }

  void AddImages() {
    std::set<std::string> names;
    for (const ColmapImage& from : records_.images) {
      image_idx_[from.id] = static_cast<int>(map_.images.size());
      if (!names.insert(from.name).second) Fail("images", from.name + " stands there twice");
      const auto camera = camera_idx_.find(from.camera_id);
      if (camera == camera_idx_.end()) {
        Fail("images", from.name + ": there is no camera " + std::to_string(from.camera_id));
      }
      MapImage& image = map_.images.emplace_back();
      image.name = from.name;
      image.camera_idx = camera->second;
      image.cam_from_world = {UnitQuaternion(from), from.translation};
      for (const Eigen::Vector2d& pixel : from.keypoints) {
        image.keypoints.push_back(FromColmapPixel(pixel));
      }
      image.point_idx.assign(image.keypoints.size(), -1);
    }
  }

  Eigen::Quaterniond UnitQuaternion(const ColmapImage& image) const {
    const double length = image.cam_from_world.coeffs().stableNorm();
    if (!(length > kLeastQuaternionLength)) Fail("images", image.name + ": the quaternion is zero");
    if (std::abs(length - 1) <= kRoundingOfUnitLength) return image.cam_from_world;
    return Eigen::Quaterniond(image.cam_from_world.coeffs() / length);
  }

  void AddPoints() {
    for (const ColmapPoint& from : records_.points) {
      MapPoint& point = map_.points.emplace_back();
      point.position = from.position;
      point.error_px = from.error_px;
      for (const auto& [image_id, keypoint] : from.track) AddObservation(from, image_id, keypoint);
      std::sort(
          point.track.begin(), point.track.end(), [](const Observation& a, const Observation& b) {
            return std::pair(a.image_idx, a.feature_idx) < std::pair(b.image_idx, b.feature_idx);
          });
      KeepOneAnImage(point.track);
    }
  }

  void AddObservation(const ColmapPoint& from, std::uint32_t image_id, std::uint32_t keypoint) {
    const auto image = image_idx_.find(image_id);
    const bool exists =
        image != image_idx_.end() && keypoint < map_.images[image->second].keypoints.size();
    if (!exists || records_.images[image->second].point_ids[keypoint] != from.id) {
      Fail("points3D", "point " + std::to_string(from.id) + ": key point " +
                           std::to_string(keypoint) + " of image " + std::to_string(image_id) +
                           (exists ? " does not name it" : " does not exist"));
    }
    map_.images[image->second].point_idx[keypoint] = static_cast<int>(map_.points.size()) - 1;
    map_.points.back().track.push_back({image->second, static_cast<int>(keypoint)});
  }

  // Marks the further ones as dropped, so that CheckKeypoints() knows them.
  void KeepOneAnImage(std::vector<Observation>& track) {
    std::vector<Observation> kept;
    for (const Observation& seen : track) {
      if (kept.empty() || kept.back().image_idx != seen.image_idx) {
        kept.push_back(seen);
      } else {
        map_.images[seen.image_idx].point_idx[seen.feature_idx] = -1;
        records_.images[seen.image_idx].point_ids[seen.feature_idx] = kNoColmapPoint;
      }
    }
    track = std::move(kept);
  }

  void CheckKeypoints() const {
    for (std::size_t i = 0; i < map_.images.size(); ++i) {
      const MapImage& image = map_.images[i];
      for (std::size_t k = 0; k < image.keypoints.size(); ++k) {
        const std::uint64_t id = records_.images[i].point_ids[k];
        if ((id == kNoColmapPoint) == (image.point_idx[k] < 0)) continue;
        Fail("images", image.name + ": key point " + std::to_string(k) + " names point " +
                           std::to_string(id) + ", whose track does not hold it");
      }
    }
  }

  fs::path folder_;
  const char* extension_;
  ColmapRecords records_;
  Reconstruction map_;
  std::unordered_map<std::uint32_t, int> camera_idx_;
  std::unordered_map<std::uint32_t, int> image_idx_;
};

ColmapImage ToRecord(const MapImage& image, std::uint32_t id) {
  ColmapImage to{id,
                 image.cam_from_world.rotation,
                 image.cam_from_world.translation,
                 static_cast<std::uint32_t>(image.camera_idx) + 1,
                 image.name,
                 {},
                 {}};
  for (std::size_t i = 0; i < image.keypoints.size(); ++i) {
    to.keypoints.push_back(ToColmapPixel(image.keypoints[i]));
    const int point = i < image.point_idx.size() ? image.point_idx[i] : -1;
    to.point_ids.push_back(point < 0 ? kNoColmapPoint : static_cast<std::uint64_t>(point) + 1);
  }
  return to;
}

ColmapPoint ToRecord(const MapPoint& point, std::uint64_t id) {
  ColmapPoint to{id, point.position, point.error_px, {}};
  for (const Observation& seen : point.track) {
    to.track.emplace_back(seen.image_idx + 1, seen.feature_idx);
  }
  return to;
}

ColmapRecords ToRecords(const Reconstruction& map) {
  ColmapRecords records;
  for (const Camera& camera : map.cameras) {
    records.cameras.push_back(
        CameraToColmap(camera, static_cast<std::uint32_t>(records.cameras.size()) + 1));
  }
  for (const MapImage& image : map.images) {
    records.images.push_back(
        ToRecord(image, static_cast<std::uint32_t>(records.images.size()) + 1));
  }
  for (const MapPoint& point : map.points) {
    records.points.push_back(ToRecord(point, records.points.size() + 1));
  }
  return records;
}

void RefuseOtherFormat(const fs::path& folder, ColmapFormat format) {
  const bool is_text = format == ColmapFormat::kText;
  const ColmapFormat other = is_text ? ColmapFormat::kBinary : ColmapFormat::kText;
  if (!HasModel(folder, other)) return;
  throw ToolError(folder.string() + " holds a COLMAP model in " + (is_text ? "binary" : "text") +
                  " already");
}

}  // namespace

std::optional<ColmapFormat> FindColmapModel(const fs::path& folder) {
  if (HasModel(folder, ColmapFormat::kBinary)) return ColmapFormat::kBinary;
  if (HasModel(folder, ColmapFormat::kText)) return ColmapFormat::kText;
  return std::nullopt;
}

Reconstruction ReadColmapModel(const fs::path& folder) {
  const std::optional<ColmapFormat> format = FindColmapModel(folder);
  if (!format) {
    throw ToolError(folder.string() +
                    " holds no COLMAP model: cameras, images and points3D, .bin or .txt");
  }
  ColmapRecords records =
      *format == ColmapFormat::kText ? ReadColmapText(folder) : ReadColmapBinary(folder);
  return Assembler(folder, ExtensionOf(*format), std::move(records)).Assemble();
}

void WriteColmapModel(const Reconstruction& map, const fs::path& folder, ColmapFormat format) {
  RefuseOtherFormat(folder, format);
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw ToolError("cannot make folder " + folder.string() + ": " + error.message());
  const ColmapRecords records = ToRecords(map);
  if (format == ColmapFormat::kText) {
    WriteColmapText(records, folder);
  } else {
    WriteColmapBinary(records, folder);
  }
}

}  // namespace viewfix
