// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "firmware_tools/mapping/reconstruction.h"
#include "platform/csv.h"

namespace viewfix {

// x_in_b = scale * rotation * x_in_a + translation
struct Similarity {
  double scale = 1;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  // unit
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& point_in_a) const {
    return scale * (rotation * point_in_a) + translation;
  }
};

// a_from_b, given b_from_a.
Similarity Inverse(const Similarity& b_from_a);

// The least-squares similarity b_from_a of point pairs; never a mirror image.
// S. Umeyama, Least-squares estimation of transformation parameters between two point patterns,
// TPAMI 1991. Nothing: fewer than three pairs, or all on a line.
std::optional<Similarity> FitSimilarity(std::span<const Eigen::Vector3d> points_in_a,
                                        std::span<const Eigen::Vector3d> points_in_b);

// A place in site coordinates, metres, and what stands there: a camera, by its image.
struct ControlPoint {
  std::string name;
  Eigen::Vector3d point_in_site = Eigen::Vector3d::Zero();
};

// A cell as a coordinate: finite, at most 1e9. Throws ToolError naming file, line and cause.
double CoordinateOf(const CsvTable::Row& row, int column, const std::filesystem::path& file);

// CSV with the columns name,x,y,z. Throws ToolError naming file, line and cause.
std::vector<ControlPoint> ReadControlFile(const std::filesystem::path& file);

// The same point in the map and on the site.
struct ControlPair {
  std::string name;
  Eigen::Vector3d point_in_map = Eigen::Vector3d::Zero();
  Eigen::Vector3d point_in_site = Eigen::Vector3d::Zero();
};

// The control points whose name is the path of an image of the map or, where only one image has
// it, its file name or its name without folder and extension: paired with the image's camera
// centre. Names of no image, or of several, are left out (they may be of another map).
std::vector<ControlPair> PairWithCameras(const Reconstruction& map,
                                         std::span<const ControlPoint> controls);

// Which way is up, from cameras that people or robots carry level: their x axes are horizontal,
// so up is the direction most orthogonal to all of them, on the side of their -y axes.
struct Gravity {
  std::optional<Eigen::Vector3d> up_in_map;  // unit
  std::string cause = "not known";           // why there is none
};
Gravity EstimateGravity(const Reconstruction& map);

struct GeoreferenceOptions {
  double max_residual = 0.5;      // metres; what is further off is an outlier
  double max_median = 0.25;       // metres; a fit worse than this is refused
  double min_inlier_share = 0.6;  // of the pairs
  // Radians: about 2 degrees, what level cameras tell. Points whose noise leaves more about the
  // line that they are nearest to are on a line, whatever they say of it.
  double max_roll_sigma = 0.035;
  int max_trials = 5000;  // minimal sets tried; all of them where there are fewer
  std::uint64_t seed = 1;
};

struct ControlResidual {
  std::string name;
  double metres = 0;
  bool is_inlier = false;
};

struct Georeference {
  Similarity site_from_map;
  std::vector<ControlResidual> residuals;  // in the order of the pairs
  double median_metres = 0;                // over all pairs
  // The points are nearly on a line: how the map is turned about it was read off its cameras.
  bool upright_by_cameras = false;
};

// The similarity that most pairs agree with: FitSimilarity() of minimal sets, then of all
// inliers. Where these lie so nearly on a line that the rotation about it is loose, `gravity`
// decides that: up becomes z. Deterministic. Throws ToolError naming the worst points: fewer than
// three pairs, a line where gravity is unknown or along it, too few inliers, too large a median
// (also where the site's coordinates are a mirror image).
Georeference FitGeoreference(std::span<const ControlPair> pairs, const Gravity& gravity = {},
                             const GeoreferenceOptions& options = {});

// "a.jpg 0.02 m, b.jpg 3.10 m (left out)": for people.
std::string DescribeResiduals(const Georeference& georeference);

// Turns the map's up into z: for maps without control points. The origin stays.
Similarity LevelFromMap(const Eigen::Vector3d& up_in_map);

// Whether `site_from_map` stands the map on its head: what mirrored coordinates of points at one
// height do without any residual. False where the walk does not tell.
bool IsUpsideDown(const Reconstruction& map, const Similarity& site_from_map);

// Takes poses and points to another frame; pixels stay.
void Transform(Reconstruction& map, const Similarity& new_from_old);

}  // namespace viewfix
