// SPDX-License-Identifier: BSD-3-Clause
#include <bit>
#include <cmath>
#include <cstring>

#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/dataset/tool_file.h"
#include "firmware_tools/mapping/colmap_records.h"

namespace viewfix {
namespace {

namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little, "COLMAP's files are little-endian");

// Least bytes of a record, so that a count can be held against what is left of the file.
constexpr std::size_t kLeastCamera = 24 + 3 * 8;
constexpr std::size_t kLeastImage = 4 + 7 * 8 + 4 + 1 + 8;
constexpr std::size_t kKeypoint = 3 * 8;
constexpr std::size_t kLeastPoint = 8 + 3 * 8 + 3 + 8 + 8;
constexpr std::size_t kTrackElement = 2 * 4;

class BinaryReader {
 public:
  explicit BinaryReader(const fs::path& file) : file_(file), bytes_(ReadTextFile(file)) {}

  template <typename T>
  T Get() {
    if (bytes_.size() - at_ < sizeof(T)) Fail("cut short");
    T value;
    std::memcpy(&value, bytes_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    return value;
  }

  double Number() {
    const double value = Get<double>();
    if (!std::isfinite(value)) Fail("a number that is not finite");
    return value;
  }

  Eigen::Vector3d Vector3() {
    const double x = Number(), y = Number(), z = Number();
    return {x, y, z};
  }

  std::size_t Count(std::size_t least_bytes_each) {
    const std::uint64_t count = Get<std::uint64_t>();
    if (count > (bytes_.size() - at_) / least_bytes_each) {
      Fail("cut short, or a count beyond the file's size");
    }
    return count;
  }

  std::string Name() {
    const std::size_t end = bytes_.find('\0', at_);
    if (end == std::string::npos) Fail("a name without end");
    std::string name = bytes_.substr(at_, end - at_);
    at_ = end + 1;
    if (name.empty()) Fail("an image without name");
    return name;
  }

  void ExpectEnd() const {
    if (at_ != bytes_.size()) Fail("bytes behind the last record");
  }

  [[noreturn]] void Fail(const std::string& cause) const {
    throw ToolError(file_.string() + " byte " + std::to_string(at_) + ": " + cause);
  }

 private:
  fs::path file_;
  std::string bytes_;
  std::size_t at_ = 0;
};

std::vector<ColmapCamera> ReadCameras(const fs::path& file) {
  BinaryReader reader(file);
  std::vector<ColmapCamera> cameras(reader.Count(kLeastCamera));
  for (ColmapCamera& camera : cameras) {
    camera.id = reader.Get<std::uint32_t>();
    const int model = reader.Get<std::int32_t>();
    camera.model = FindColmapCameraModel(model);
    if (camera.model == nullptr) {
      reader.Fail("camera model number " + std::to_string(model) + " is not supported");
    }
    camera.width = reader.Get<std::uint64_t>();
    camera.height = reader.Get<std::uint64_t>();
    for (int i = 0; i < camera.model->num_params; ++i) camera.params.push_back(reader.Number());
  }
  reader.ExpectEnd();
  return cameras;
}

std::vector<ColmapImage> ReadImages(const fs::path& file) {
  BinaryReader reader(file);
  std::vector<ColmapImage> images(reader.Count(kLeastImage));
  for (ColmapImage& image : images) {
    image.id = reader.Get<std::uint32_t>();
    image.cam_from_world.w() = reader.Number();
    image.cam_from_world.vec() = reader.Vector3();
    image.translation = reader.Vector3();
    image.camera_id = reader.Get<std::uint32_t>();
    image.name = reader.Name();
    image.keypoints.resize(reader.Count(kKeypoint));
    image.point_ids.resize(image.keypoints.size());
    for (std::size_t i = 0; i < image.keypoints.size(); ++i) {
      const double x = reader.Number(), y = reader.Number();
      image.keypoints[i] = {x, y};
      image.point_ids[i] = reader.Get<std::uint64_t>();
    }
  }
  reader.ExpectEnd();
  return images;
}

std::vector<ColmapPoint> ReadPoints(const fs::path& file) {
  BinaryReader reader(file);
  std::vector<ColmapPoint> points(reader.Count(kLeastPoint));
  for (ColmapPoint& point : points) {
    point.id = reader.Get<std::uint64_t>();
    point.position = reader.Vector3();
    for (int i = 0; i < 3; ++i) reader.Get<std::uint8_t>();  // colour
    point.error_px = reader.Number();
    point.track.resize(reader.Count(kTrackElement));
    for (auto& [image_id, keypoint] : point.track) {
      image_id = reader.Get<std::uint32_t>();
      keypoint = reader.Get<std::uint32_t>();
    }
  }
  reader.ExpectEnd();
  return points;
}

class BinaryWriter {
 public:
  template <typename T>
  void Put(T value) {
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof(T));
  }
  void Put(const Eigen::Vector3d& v) {
    for (const double value : v) Put(value);
  }
  void PutCount(std::size_t count) { Put(std::uint64_t{count}); }
  void PutName(const std::string& name) { bytes_.append(name.c_str(), name.size() + 1); }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

std::string CamerasBytes(const ColmapRecords& records) {
  BinaryWriter writer;
  writer.PutCount(records.cameras.size());
  for (const ColmapCamera& camera : records.cameras) {
    writer.Put(camera.id);
    writer.Put(std::int32_t{camera.model->id});
    writer.Put(camera.width);
    writer.Put(camera.height);
    for (const double value : camera.params) writer.Put(value);
  }
  return writer.bytes();
}

std::string ImagesBytes(const ColmapRecords& records) {
  BinaryWriter writer;
  writer.PutCount(records.images.size());
  for (const ColmapImage& image : records.images) {
    writer.Put(image.id);
    writer.Put(image.cam_from_world.w());
    writer.Put(Eigen::Vector3d(image.cam_from_world.vec()));
    writer.Put(image.translation);
    writer.Put(image.camera_id);
    writer.PutName(image.name);
    writer.PutCount(image.keypoints.size());
    for (std::size_t i = 0; i < image.keypoints.size(); ++i) {
      writer.Put(image.keypoints[i].x());
      writer.Put(image.keypoints[i].y());
      writer.Put(image.point_ids[i]);
    }
  }
  return writer.bytes();
}

std::string PointsBytes(const ColmapRecords& records) {
  BinaryWriter writer;
  writer.PutCount(records.points.size());
  for (const ColmapPoint& point : records.points) {
    writer.Put(point.id);
    writer.Put(point.position);
    for (int i = 0; i < 3; ++i) writer.Put(std::uint8_t{128});
    writer.Put(point.error_px);
    writer.PutCount(point.track.size());
    for (const auto& [image_id, keypoint] : point.track) {
      writer.Put(image_id);
      writer.Put(keypoint);
    }
  }
  return writer.bytes();
}

}  // namespace

ColmapRecords ReadColmapBinary(const fs::path& folder) {
  return {ReadCameras(folder / "cameras.bin"), ReadImages(folder / "images.bin"),
          ReadPoints(folder / "points3D.bin")};
}

void WriteColmapBinary(const ColmapRecords& records, const fs::path& folder) {
  WriteTextFile(folder / "cameras.bin", CamerasBytes(records));
  WriteTextFile(folder / "images.bin", ImagesBytes(records));
  WriteTextFile(folder / "points3D.bin", PointsBytes(records));
}

}  // namespace viewfix
