// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/tags.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <opencv2/aruco.hpp>
#include <opencv2/core.hpp>
#include <optional>

#include "firmware_tools/dataset/image_loader.h"
#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/dataset/tool_file.h"
#include "platform/csv.h"

namespace viewfix {
namespace {

namespace fs = std::filesystem;

constexpr double kMaxCoordinate = 1e9;    // metres
constexpr double kLeastParallax = 0.035;  // radians: 2 degrees
constexpr double kMaxMiss = 0.0175;       // radians: 1 degree
constexpr double kMaxQuaternionError = 1e-2;
constexpr double kMaxCornerError = 0.2;  // of the mean side: sides of a square are alike

struct Family {
  const char* name;
  cv::aruco::PREDEFINED_DICTIONARY_NAME dictionary;
};

constexpr Family kFamilies[] = {
    {"4x4_50", cv::aruco::DICT_4X4_50},
    {"4x4_100", cv::aruco::DICT_4X4_100},
    {"4x4_250", cv::aruco::DICT_4X4_250},
    {"4x4_1000", cv::aruco::DICT_4X4_1000},
    {"5x5_50", cv::aruco::DICT_5X5_50},
    {"5x5_100", cv::aruco::DICT_5X5_100},
    {"5x5_250", cv::aruco::DICT_5X5_250},
    {"5x5_1000", cv::aruco::DICT_5X5_1000},
    {"6x6_50", cv::aruco::DICT_6X6_50},
    {"6x6_100", cv::aruco::DICT_6X6_100},
    {"6x6_250", cv::aruco::DICT_6X6_250},
    {"6x6_1000", cv::aruco::DICT_6X6_1000},
    {"7x7_50", cv::aruco::DICT_7X7_50},
    {"7x7_100", cv::aruco::DICT_7X7_100},
    {"7x7_250", cv::aruco::DICT_7X7_250},
    {"7x7_1000", cv::aruco::DICT_7X7_1000},
    {"aruco_original", cv::aruco::DICT_ARUCO_ORIGINAL},
    {"tag16h5", cv::aruco::DICT_APRILTAG_16h5},
    {"tag25h9", cv::aruco::DICT_APRILTAG_25h9},
    {"tag36h10", cv::aruco::DICT_APRILTAG_36h10},
    {"tag36h11", cv::aruco::DICT_APRILTAG_36h11},
};

const Family* FindFamily(const std::string& name) {
  const auto found = std::find_if(std::begin(kFamilies), std::end(kFamilies),
                                  [&](const Family& family) { return family.name == name; });
  return found == std::end(kFamilies) ? nullptr : found;
}

// Turns the rows of the CSV into tags.
class TagReader {
 public:
  explicit TagReader(const fs::path& file) : file_(file) {}

  std::vector<Tag> Read() {
    Result<CsvTable> table = ParseCsv(ReadTextFile(file_));
    if (!table.ok()) throw ToolError(file_.string() + ": " + Describe(table.status()));
    table_ = std::move(*table);
    if (table_.Column("family") < 0 || table_.Column("id") < 0) Fail("no columns family and id");
    const bool has_corners = table_.Column("x0") >= 0;
    std::vector<Tag> tags;
    for (const CsvTable::Row& row : table_.rows) {
      row_ = &row;
      Tag& tag = tags.emplace_back();
      tag.family = row.cells[table_.Column("family")];
      ReadId(tag);
      tag.corners_in_site = has_corners ? Corners() : CornersOfPose();
      CheckSquare(tag);
      const auto twin = std::find_if(tags.begin(), tags.end() - 1, [&](const Tag& other) {
        return other.family == tag.family && other.id == tag.id;
      });
      if (twin != tags.end() - 1) Fail("the tag stands there twice");
    }
    return tags;
  }

 private:
  [[noreturn]] void Fail(const std::string& cause) const {
    const std::string line = row_ == nullptr ? "" : " line " + std::to_string(row_->line);
    throw ToolError(file_.string() + line + ": " + cause);
  }

  double Number(const std::string& column) const {
    const int index = table_.Column(column);
    if (index < 0) Fail("no column called " + column);
    const std::string& cell = row_->cells[index];
    double value = 0;
    const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
    const bool whole = error == std::errc() && end == cell.data() + cell.size();
    if (!whole || !(std::abs(value) <= kMaxCoordinate)) {
      Fail(column + " is not a number in range: " + cell.substr(0, 40));
    }
    return value;
  }

  void ReadId(Tag& tag) const {
    const Family* family = FindFamily(tag.family);
    if (family == nullptr) Fail("no tag family " + tag.family.substr(0, 40));
    const double id = Number("id");
    const int count = cv::aruco::getPredefinedDictionary(family->dictionary)->bytesList.rows;
    if (id != std::floor(id) || id < 0 || id >= count) Fail("the family has no tag of this id");
    tag.id = static_cast<int>(id);
  }

  std::array<Eigen::Vector3d, 4> Corners() const {
    std::array<Eigen::Vector3d, 4> corners;
    for (int i = 0; i < 4; ++i) {
      const auto at = [&](const char* axis) {
        std::string column = axis;
        return Number(column += std::to_string(i));
      };
      corners[i] = {at("x"), at("y"), at("z")};
    }
    return corners;
  }

  std::array<Eigen::Vector3d, 4> CornersOfPose() const {
    const double half = Number("size_m") / 2;
    if (!(half > 0)) Fail("size_m is not positive");
    Eigen::Quaterniond q(Number("qw"), Number("qx"), Number("qy"), Number("qz"));
    if (!(std::abs(q.norm() - 1) <= kMaxQuaternionError)) {
      Fail("the quaternion qx,qy,qz,qw has not length 1");
    }
    const Rigid3 site_from_tag{q.normalized(), {Number("tx"), Number("ty"), Number("tz")}};
    return {site_from_tag * Eigen::Vector3d(-half, half, 0),
            site_from_tag * Eigen::Vector3d(half, half, 0),
            site_from_tag * Eigen::Vector3d(half, -half, 0),
            site_from_tag * Eigen::Vector3d(-half, -half, 0)};
  }

  void CheckSquare(const Tag& tag) const {
    const auto& c = tag.corners_in_site;
    double mean = 0;
    for (int i = 0; i < 4; ++i) mean += (c[(i + 1) % 4] - c[i]).norm() / 4;
    for (int i = 0; i < 4; ++i) {
      const double side = (c[(i + 1) % 4] - c[i]).norm();
      if (mean > 0 && std::abs(side - mean) <= kMaxCornerError * mean) continue;
      Fail("the corners are not those of a square");
    }
  }

  fs::path file_;
  CsvTable table_;
  const CsvTable::Row* row_ = nullptr;
};

// Pixels of the image as it was read -> pixels of the camera.
Eigen::Vector2d ToCameraPixel(const cv::Point2f& pixel, const YuvImage& image,
                              const Camera& camera) {
  return {(pixel.x + 0.5) * camera.width / image.width - 0.5,
          (pixel.y + 0.5) * camera.height / image.height - 0.5};
}

// Detects the tags of one family.
class Detector {
 public:
  Detector(const Reconstruction& map, std::span<const Tag> tags, const std::string& family)
      : map_(map), dictionary_(cv::aruco::getPredefinedDictionary(FindFamily(family)->dictionary)) {
    for (int i = 0; i < static_cast<int>(tags.size()); ++i) {
      if (tags[i].family == family) tag_idx_[tags[i].id] = i;
    }
    parameters_ = cv::aruco::DetectorParameters::create();
    parameters_->cornerRefinementMethod = cv::aruco::CORNER_REFINE_SUBPIX;
  }

  void Detect(const YuvImage& image, int image_idx, std::vector<TagObservation>& seen) const {
    const cv::Mat pixels(image.height, image.width, CV_8U,
                         const_cast<std::uint8_t*>(image.pixels.data()));
    std::vector<std::vector<cv::Point2f>> corners;
    std::vector<int> ids;
    cv::aruco::detectMarkers(pixels, dictionary_, corners, ids, parameters_);
    for (std::size_t i = 0; i < ids.size(); ++i) {
      const auto tag = tag_idx_.find(ids[i]);
      if (tag == tag_idx_.end() || std::count(ids.begin(), ids.end(), ids[i]) > 1) continue;
      TagObservation observation{image_idx, tag->second, {}};
      const Camera& camera = map_.cameras.at(map_.images[image_idx].camera_idx);
      for (int k = 0; k < 4; ++k) {
        observation.corners[k] = ToCameraPixel(corners[i][k], image, camera);
      }
      seen.push_back(observation);
    }
  }

 private:
  const Reconstruction& map_;
  cv::Ptr<cv::aruco::Dictionary> dictionary_;
  cv::Ptr<cv::aruco::DetectorParameters> parameters_;
  std::map<int, int> tag_idx_;  // by id
};

struct Ray {
  Eigen::Vector3d origin, direction;  // in the map; unit
};

// The point nearest to all rays, by least squares.
std::optional<Eigen::Vector3d> Meet(const std::vector<Ray>& rays) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  double widest = 0;
  for (const Ray& ray : rays) {
    const Eigen::Matrix3d off =
        Eigen::Matrix3d::Identity() - ray.direction * ray.direction.transpose();
    normal += off;
    right += off * ray.origin;
    widest = std::max(widest, rays.front().direction.cross(ray.direction).norm());
  }
  if (rays.size() < 2 || widest < std::sin(kLeastParallax)) return std::nullopt;
  return Eigen::Vector3d(normal.ldlt().solve(right));
}

std::optional<Eigen::Vector3d> TriangulateRays(std::vector<Ray> rays) {
  const std::optional<Eigen::Vector3d> first = Meet(rays);
  if (!first) return first;
  std::erase_if(rays, [&](const Ray& ray) {
    const Eigen::Vector3d to_point = (*first - ray.origin).normalized();
    return to_point.dot(ray.direction) < std::cos(kMaxMiss);
  });
  return Meet(rays);
}

std::optional<Ray> RayOf(const Reconstruction& map, int image_idx, const Eigen::Vector2d& pixel) {
  const MapImage& image = map.images.at(image_idx);
  Eigen::Vector3d bearing;
  if (!map.cameras.at(image.camera_idx).Unproject(pixel, bearing)) return std::nullopt;
  const Rigid3 map_from_cam = Inverse(image.cam_from_world);
  return Ray{map_from_cam.translation, map_from_cam.rotation * bearing};
}

}  // namespace

std::vector<Tag> ReadTagFile(const fs::path& file) { return TagReader(file).Read(); }

std::vector<TagObservation> DetectTags(const Reconstruction& map, std::span<const Tag> tags,
                                       const fs::path& folder) {
  std::map<std::string, Detector> detectors;
  for (const Tag& tag : tags) {
    detectors.try_emplace(tag.family, map, tags, tag.family);
  }
  std::vector<TagObservation> seen;
  for (int i = 0; i < static_cast<int>(map.images.size()); ++i) {
    YuvImage image;
    try {
      image = LoadImage(folder / map.images[i].name);
    } catch (const ToolError&) {
      continue;
    }
    for (const auto& [family, detector] : detectors) detector.Detect(image, i, seen);
  }
  return seen;
}

std::vector<ControlPair> TriangulateTags(const Reconstruction& map, std::span<const Tag> tags,
                                         std::span<const TagObservation> observations) {
  std::vector<std::array<std::vector<Ray>, 4>> rays(tags.size());
  for (const TagObservation& seen : observations) {
    for (int k = 0; k < 4; ++k) {
      const std::optional<Ray> ray = RayOf(map, seen.image_idx, seen.corners[k]);
      if (ray) rays.at(seen.tag_idx)[k].push_back(*ray);
    }
  }
  std::vector<ControlPair> pairs;
  for (std::size_t t = 0; t < tags.size(); ++t) {
    for (int k = 0; k < 4; ++k) {
      const std::optional<Eigen::Vector3d> point = TriangulateRays(rays[t][k]);
      if (!point) continue;
      std::string name = tags[t].family;
      name.append(" ").append(std::to_string(tags[t].id));
      name.append(" corner ").append(std::to_string(k));
      pairs.push_back({name, *point, tags[t].corners_in_site[k]});
    }
  }
  return pairs;
}

}  // namespace viewfix
