// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/dataset/pose_import.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <set>

#include "firmware_tools/dataset/calibration_file.h"
#include "firmware_tools/dataset/image_loader.h"
#include "firmware_tools/dataset/text_fields.h"
#include "firmware_tools/dataset/tool_file.h"
#include "firmware_tools/mapping/colmap_model.h"

namespace viewfix {
namespace {

namespace fs = std::filesystem;

constexpr char kTransformsName[] = "transforms.json";
constexpr double kMaxQuaternionLengthError = 1e-2;
constexpr double kRoundingOfUnitLength = 1e-12;  // below it a quaternion is kept to the bit
constexpr double kMaxGapSeconds = 0.2;           // a walker turns by some degrees in it, no more
constexpr double kSameTimeSeconds = 5e-7;        // of 1.7e9 s a double resolves 2.4e-7 s
constexpr std::size_t kDigitsOfNanoseconds = 19;

std::optional<double> NumberOf(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool whole = error == std::errc() && end == text.data() + text.size();
  return whole && std::isfinite(value) ? std::optional(value) : std::nullopt;
}

// Seconds; nanoseconds where there are as many digits as of today's.
std::optional<double> TimeOf(const std::string& text) {
  const std::optional<double> value = NumberOf(text);
  const bool is_ns = text.size() == kDigitsOfNanoseconds && text.find('.') == std::string::npos;
  return value && is_ns ? *value * 1e-9 : value;
}

// "./a/../b/x.jpg" -> "b/x.jpg"
std::string PathKey(const std::string& path) {
  return fs::path(path).lexically_normal().generic_string();
}

std::string FileName(const std::string& path) { return fs::path(path).filename().string(); }

std::string Stem(const std::string& path) { return fs::path(path).stem().string(); }

// The pose of each key that only one of the poses has.
class UniqueKeys {
 public:
  void Add(const std::string& key, int pose) {
    const auto [found, is_new] = pose_by_key_.try_emplace(key, pose);
    if (!is_new) found->second = -1;
  }
  int Find(const std::string& key) const {
    const auto found = pose_by_key_.find(key);
    return found == pose_by_key_.end() ? -1 : found->second;
  }

 private:
  std::map<std::string, int> pose_by_key_;
};

// Finds the pose of an image.
class Matcher {
 public:
  explicit Matcher(const ImportedPoses& poses) : poses_(poses) {
    for (int i = 0; i < static_cast<int>(poses.images.size()); ++i) {
      const std::string& name = poses.images[i].name;
      by_path_.Add(PathKey(name), i);
      by_file_name_.Add(FileName(name), i);
      by_stem_.Add(poses.images[i].time_s ? name : Stem(name), i);
      if (poses.images[i].time_s) by_time_[*poses.images[i].time_s] = i;
    }
  }

  // The image's pose, and which of the imported ones it is (or is next to); -1: none.
  int Find(const std::string& path, Pose& pose) const {
    int found = by_path_.Find(PathKey(path));
    if (found < 0) found = by_file_name_.Find(FileName(path));
    if (found < 0) found = by_stem_.Find(Stem(path));
    if (found < 0) return FindByTime(path, pose);
    pose = poses_.images[found].pose;
    return found;
  }

 private:
  int FindByTime(const std::string& path, Pose& pose) const {
    std::optional<double> time = TimeOf(Stem(path));
    if (!time || by_time_.empty()) return -1;
    const auto after = by_time_.lower_bound(*time - kSameTimeSeconds);
    if (after == by_time_.end()) return -1;
    const Pose& b = poses_.images[after->second].pose;
    if (after->first <= *time + kSameTimeSeconds) {
      pose = b;
      return after->second;
    }
    if (after == by_time_.begin()) return -1;
    const auto before = std::prev(after);
    const double gap = after->first - before->first;
    if (gap > kMaxGapSeconds) return -1;
    const double share = (*time - before->first) / gap;
    const Pose& a = poses_.images[before->second].pose;
    pose.world_from_cam = a.world_from_cam.slerp(share, b.world_from_cam);
    pose.cam_in_world = a.cam_in_world + share * (b.cam_in_world - a.cam_in_world);
    return before->second;
  }

  const ImportedPoses& poses_;
  UniqueKeys by_path_, by_file_name_, by_stem_;
  std::map<double, int> by_time_;
};

std::optional<fs::path> FindColmapFolder(const fs::path& folder) {
  for (const char* inside : {"", "sparse/0", "sparse"}) {
    const fs::path candidate = *inside == '\0' ? folder : folder / inside;
    if (FindColmapModel(candidate)) return candidate;
  }
  return std::nullopt;
}

// The file that `name` means in `folder`, which may lack its extension; empty: none.
std::string FindImage(const fs::path& folder, const std::string& name) {
  const std::string path = PathKey(name);
  std::error_code error;
  if (fs::is_regular_file(folder / path, error)) return path;
  for (const char* extension : {".jpg", ".jpeg", ".png", ".JPG", ".JPEG", ".PNG"}) {
    if (fs::is_regular_file(folder / (path + extension), error)) return path + extension;
  }
  return {};
}

// Where the model's images stand.
fs::path ImageFolder(const fs::path& model, const std::string& name) {
  const fs::path at = fs::absolute(model).lexically_normal() / "";
  const fs::path base = at.parent_path();
  for (const fs::path& folder : {base, base.parent_path(), base.parent_path().parent_path()}) {
    for (const fs::path& candidate : {folder, folder / "images"}) {
      if (!FindImage(candidate, name).empty()) return candidate;
    }
  }
  throw ToolError(model.string() + ": cannot find its image " + name +
                  " beside it, in images/, or in a folder or two above");
}

ImageSet ToImageSet(const ImportedPoses& poses, const fs::path& folder) {
  ImageSet set;
  set.folder = folder;
  set.source = poses.source;
  set.cameras = poses.cameras;
  std::set<std::string> paths;
  for (const ImportedPose& from : poses.images) {
    ImageRecord& image = set.images.emplace_back();
    const std::string found = FindImage(folder, from.name);
    image.path = found.empty() ? PathKey(from.name) : found;
    if (!paths.insert(image.path).second) {
      throw ToolError(poses.source.string() + ": image " + image.path + " stands there twice");
    }
    image.pose = from.pose;
    image.camera_idx = from.camera_idx;
    image.is_test = from.is_test;
  }
  return set;
}

}  // namespace

ImportedPoses ReadTumTrajectory(const fs::path& file) {
  const std::string text = ReadTextFile(file);
  ImportedPoses poses;
  poses.source = file;
  for (TextFields fields(file, text); fields.NextDataLine();) {
    ImportedPose& image = poses.images.emplace_back();
    image.name = fields.Word("the timestamp");
    image.time_s = TimeOf(image.name);
    for (double& value : image.pose.cam_in_world) value = fields.Number("the position");
    Eigen::Quaterniond& q = image.pose.world_from_cam;
    for (double& value : q.coeffs()) value = fields.Number("the quaternion");
    if (!fields.AtLineEnd()) fields.Fail("more than timestamp tx ty tz qx qy qz qw");
    const double length_error = std::abs(q.coeffs().stableNorm() - 1);
    if (!(length_error <= kMaxQuaternionLengthError)) {
      fields.Fail("the quaternion qx qy qz qw has not length 1");
    }
    if (length_error > kRoundingOfUnitLength) q.normalize();
  }
  if (poses.images.empty()) throw ToolError(file.string() + ": no poses in it");
  return poses;
}

ImportedPoses ReadColmapPoses(const fs::path& folder) {
  const Reconstruction map = ReadColmapModel(folder);
  ImportedPoses poses;
  poses.source = folder;
  for (const Camera& camera : map.cameras) poses.cameras.push_back(ToCalibration(camera));
  for (const MapImage& image : map.images) {
    const Rigid3 world_from_cam = Inverse(image.cam_from_world);
    poses.images.push_back({image.name,
                            std::nullopt,
                            {world_from_cam.rotation, world_from_cam.translation},
                            image.camera_idx});
  }
  return poses;
}

ImportedPoses ReadPoses(const fs::path& path) {
  std::error_code error;
  if (!fs::is_directory(path, error)) {
    return path.extension() == ".json" ? ReadTransformsJson(path) : ReadTumTrajectory(path);
  }
  if (const auto model = FindColmapFolder(path)) return ReadColmapPoses(*model);
  if (fs::exists(path / kTransformsName, error)) return ReadTransformsJson(path / kTransformsName);
  throw ToolError(path.string() + ": neither a COLMAP model nor transforms.json in it");
}

PoseMatches ApplyPoses(const ImportedPoses& poses, ImageSet& set) {
  const Matcher matcher(poses);
  const int first_camera = static_cast<int>(set.cameras.size());
  set.cameras.insert(set.cameras.end(), poses.cameras.begin(), poses.cameras.end());
  std::set<int> used;
  PoseMatches matches;
  for (ImageRecord& image : set.images) {
    Pose pose;
    const int found = matcher.Find(image.path, pose);
    if (found < 0) {
      ++matches.unmatched;
      continue;
    }
    used.insert(found);
    image.pose = pose;
    ++matches.matched;
    const int camera = poses.images[found].camera_idx;
    if (image.camera_idx < 0 && camera >= 0) image.camera_idx = first_camera + camera;
  }
  if (matches.matched == 0) {
    throw ToolError(poses.source.string() + ": none of its names or times is that of an image of " +
                    set.source.string());
  }
  const bool has_times = poses.images.front().time_s.has_value();
  matches.unused = has_times ? 0 : static_cast<int>(poses.images.size() - used.size());
  return matches;
}

std::optional<ImageSet> LoadPosedImageSet(const fs::path& folder) {
  std::error_code error;
  if (fs::exists(folder / kTransformsName, error)) {
    return ToImageSet(ReadTransformsJson(folder / kTransformsName), folder);
  }
  const std::optional<fs::path> model = FindColmapFolder(folder);
  if (!model) return std::nullopt;
  const ImportedPoses poses = ReadColmapPoses(*model);
  if (poses.images.empty()) throw ToolError(model->string() + ": the model has no images");
  return ToImageSet(poses, ImageFolder(*model, poses.images.front().name));
}

}  // namespace viewfix
