// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "engine/geometry/camera.h"

namespace viewfix {

// The laptop side throws this, up to the command line, which prints what() on
// one line and exits with 1. what() names the file and the cause.
class ToolError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// world_from_cam: camera x right, y down, z forward; metres.
struct Pose {
  Eigen::Quaterniond world_from_cam = Eigen::Quaterniond::Identity();  // unit
  Eigen::Vector3d cam_in_world = Eigen::Vector3d::Zero();
};

struct Calibration {
  int width = 0;                          // pixels
  int height = 0;                         // pixels
  double fx = 0, fy = 0, cx = 0, cy = 0;  // pixels, centres at integers
  std::vector<double> distortion;         // OpenCV order: k1 k2 p1 p2 k3 ...; of a fisheye k1..k4
  CameraModel model = CameraModel::kBrownConrady;  // without coefficients as good as kPinhole
};

struct ImageRecord {
  std::string path;      // as written in the set, relative to its folder
  std::string location;  // slash-separated hierarchy; empty: not labelled
  std::string view;      // empty: not labelled
  std::string capture;   // name of one walk; empty: the set names none
  bool is_test = false;
  std::optional<Pose> pose;
  int camera_idx = -1;                       // into ImageSet::cameras; -1: not known
  std::map<std::string, std::string> other;  // unknown columns, kept
};

inline constexpr char kCalibrationName[] = "calibration.yaml";

// An image set as in interfaces.md: images.csv (or another CSV), or folders
// <location>/<view>/*.jpg. Records keep the CSV's order (name order for folders).
struct ImageSet {
  std::filesystem::path folder;  // paths are relative to it
  std::filesystem::path source;  // the CSV, or the folder itself
  std::vector<ImageRecord> images;
  std::vector<Calibration> cameras;

  std::filesystem::path FullPath(const ImageRecord& image) const { return folder / image.path; }
  // Of the cameras that no image names: need not be there.
  std::filesystem::path DefaultCalibration() const { return folder / kCalibrationName; }
};

// `path`: a folder, or a CSV file. A folder without images.csv may be described by its
// transforms.json or COLMAP model instead (pose_import.h). Throws ToolError naming file, line and
// cause: no such folder, no `path` column, a duplicate path, a pose column missing or not finite, a
// quaternion far from unit length, a split other than train/test, a broken calibration.
// Files named but absent are not an error here: reading them is.
ImageSet LoadImageSet(const std::filesystem::path& path);

// Writes folder/images.csv with the columns that are used, atomically.
void SaveImageSet(const ImageSet& set);

}  // namespace viewfix
