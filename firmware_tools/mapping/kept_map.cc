// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/kept_map.h"

#include "firmware_tools/mapping/map_bytes.h"

namespace viewfix {
namespace {

// Rises whenever the same photographs would give another map, be it by another default of
// SfmOptions, or the file below changes.
constexpr int kKeptVersion = 1;

//   position  in its walk: frames that are far apart make loops
void AddFrame(const MapFrame& frame, int position, ContentHash& hash) {
  hash.AddText(frame.name);
  hash.AddText(frame.capture);
  hash.Add(frame.time);
  hash.Add(position);
  hash.Add(frame.camera_idx);
  hash.Add(frame.readout);
  for (const Keypoint& k : frame.features->keypoints) {
    for (const float v : {k.x, k.y, k.sigma, k.cos_angle, k.sin_angle, k.response}) hash.Add(v);
    hash.Add(k.laplacian_sign);
  }
  hash.AddAll(std::span<const std::int8_t>(frame.features->descriptors));
}

// Frames are named by their place among those with features: what else the set holds does not
// count.
class FrameNumbers {
 public:
  explicit FrameNumbers(const MapInput& input) {
    for (const MapFrame& frame : input.frames) {
      number_.push_back(count_);
      if (!frame.features->keypoints.empty()) ++count_;
    }
  }
  void Add(const FramePair& pair, ContentHash& hash) const {
    hash.Add(number_[pair.first_idx]);
    hash.Add(number_[pair.second_idx]);
  }

 private:
  int count_ = 0;
  std::vector<int> number_;  // [frames]
};

void SaveMapImage(const MapImage& image, ByteWriter& writer) {
  writer.Add(std::uint64_t{image.name.size()});
  writer.AddAll(std::span<const char>(image.name));
  writer.Add(image.camera_idx);
  SavePose(image.cam_from_world, writer);
  writer.AddAll(std::span<const double>(image.motion.turn.data(), 3));
  writer.AddAll(std::span<const double>(image.motion.shift.data(), 3));
  writer.Add(image.readout);
  writer.Add(std::uint64_t{image.keypoints.size()});
  for (const auto& keypoint : image.keypoints) {
    writer.AddAll(std::span<const double>(keypoint.data(), 2));
  }
  writer.AddAll(std::span<const int>(image.point_idx));
}

bool LoadMapImage(ByteReader& reader, const Reconstruction& map, MapImage& image) {
  const auto name = reader.Take<std::uint64_t>();
  if (!reader.Has(name, 1)) return false;
  image.name.resize(name);
  reader.TakeAll(std::span<char>(image.name));
  image.camera_idx = reader.Take<int>();
  LoadPose(reader, image.cam_from_world);
  reader.TakeAll(std::span<double>(image.motion.turn.data(), 3));
  reader.TakeAll(std::span<double>(image.motion.shift.data(), 3));
  image.readout = reader.Take<double>();
  const auto keypoints = reader.Take<std::uint64_t>();
  if (!reader.Has(keypoints, 2 * sizeof(double) + sizeof(int))) return false;
  image.keypoints.resize(keypoints);
  image.point_idx.resize(keypoints);
  for (auto& keypoint : image.keypoints) {
    reader.TakeAll(std::span<double>(keypoint.data(), 2));
  }
  reader.TakeAll(std::span<int>(image.point_idx));
  const int points = static_cast<int>(map.points.size());
  for (const int point : image.point_idx) {
    if (point < -1 || point >= points) return false;
  }
  return image.camera_idx >= 0 && image.camera_idx < static_cast<int>(map.cameras.size());
}

void SavePoint(const MapPoint& point, ByteWriter& writer) {
  writer.AddAll(std::span<const double>(point.position.data(), 3));
  writer.Add(point.error_px);
  writer.Add(std::uint64_t{point.track.size()});
  for (const Observation& o : point.track) {
    writer.Add(o.image_idx);
    writer.Add(o.feature_idx);
  }
}

bool LoadPoint(ByteReader& reader, MapPoint& point) {
  reader.TakeAll(std::span<double>(point.position.data(), 3));
  point.error_px = reader.Take<double>();
  const auto track = reader.Take<std::uint64_t>();
  if (!reader.Has(track, 2 * sizeof(int))) return false;
  point.track.resize(track);
  for (Observation& o : point.track) {
    o.image_idx = reader.Take<int>();
    o.feature_idx = reader.Take<int>();
  }
  return true;
}

bool TracksAreInRange(const Reconstruction& map) {
  for (const MapPoint& point : map.points) {
    for (const Observation& o : point.track) {
      if (o.image_idx < 0 || o.image_idx >= static_cast<int>(map.images.size())) return false;
      const auto& keypoints = map.images[o.image_idx].keypoints;
      if (o.feature_idx < 0 || o.feature_idx >= static_cast<int>(keypoints.size())) return false;
    }
  }
  return true;
}

}  // namespace

Hash256 MapKey(const MapInput& input, std::span<const FramePair> candidates,
               std::span<const VerifiedPair> pairs, const ColmapOptions& options) {
  ContentHash key;
  key.AddText("map");
  key.Add(kKeptVersion);
  key.AddText(options.program);
  key.Add(options.seed);
  key.Add(options.refine_focal);
  key.Add(options.max_trials);
  key.Add(options.min_registered);
  key.Add(options.max_open);
  const CaptureOrder order(input);
  for (int f = 0; f < static_cast<int>(input.frames.size()); ++f) {
    const MapFrame& frame = input.frames[f];
    if (frame.features->keypoints.empty()) continue;
    AddFrame(frame, order.Position(f), key);
    HashCamera(input.cameras[frame.camera_idx], key);
  }
  const FrameNumbers numbers(input);
  key.Add(std::uint64_t{candidates.size()});
  for (const FramePair& pair : candidates) numbers.Add(pair, key);
  for (const VerifiedPair& pair : pairs) {
    numbers.Add(pair.frames, key);
    key.Add(pair.median_angle_deg);
    HashPose(pair.second_from_first, key);
    key.Add(std::uint64_t{pair.matches.size()});
    for (const FeatureMatch& match : pair.matches) {
      key.Add(match.first_idx);
      key.Add(match.second_idx);
      key.Add(match.distance2);
    }
  }
  return key.Result();
}

void MapCodec::Save(const Reconstruction& map, ByteWriter& writer) const {
  writer.Add(std::uint64_t{map.cameras.size()});
  for (const Camera& camera : map.cameras) {
    writer.Add(static_cast<int>(camera.model));
    writer.Add(camera.width);
    writer.Add(camera.height);
    for (const double v : {camera.fx, camera.fy, camera.cx, camera.cy}) writer.Add(v);
    writer.AddAll(std::span<const double>(camera.distortion));
  }
  writer.Add(std::uint64_t{map.points.size()});
  for (const MapPoint& point : map.points) SavePoint(point, writer);
  writer.Add(std::uint64_t{map.images.size()});
  for (const MapImage& image : map.images) SaveMapImage(image, writer);
}

bool MapCodec::Load(ByteReader& reader, Reconstruction& map) const {
  const auto cameras = reader.Take<std::uint64_t>();
  if (!reader.Has(cameras, 3 * sizeof(int) + 12 * sizeof(double))) return false;
  map.cameras.resize(cameras);
  for (Camera& camera : map.cameras) {
    camera.model = static_cast<CameraModel>(reader.Take<int>());
    camera.width = reader.Take<int>();
    camera.height = reader.Take<int>();
    for (double* v : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) *v = reader.Take<double>();
    reader.TakeAll(std::span<double>(camera.distortion));
  }
  const auto points = reader.Take<std::uint64_t>();
  if (!reader.Has(points, 4 * sizeof(double) + sizeof(std::uint64_t))) return false;
  map.points.resize(points);
  for (MapPoint& point : map.points) {
    if (!LoadPoint(reader, point)) return false;
  }
  const auto images = reader.Take<std::uint64_t>();
  if (!reader.Has(images, 14 * sizeof(double) + 2 * sizeof(std::uint64_t) + sizeof(int))) {
    return false;
  }
  map.images.resize(images);
  for (MapImage& image : map.images) {
    if (!LoadMapImage(reader, map, image)) return false;
  }
  return TracksAreInRange(map);
}

}  // namespace viewfix
