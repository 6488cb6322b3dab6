// SPDX-License-Identifier: BSD-3-Clause
// nerfstudio's transforms.json.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "firmware_tools/dataset/calibration_file.h"
#include "firmware_tools/dataset/pose_import.h"
#include "firmware_tools/dataset/tool_file.h"
#include "firmware_tools/mapping/colmap_convention.h"

namespace viewfix {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr double kMaxRotationError = 1e-3;  // of an entry of R R^T
constexpr double kMaxCoordinate = 1e9;
constexpr double kMaxSide = 1 << 20;  // pixels

bool IsRotation(const Eigen::Matrix3d& r) {
  const Eigen::Matrix3d error = r * r.transpose() - Eigen::Matrix3d::Identity();
  return error.cwiseAbs().maxCoeff() <= kMaxRotationError && r.determinant() > 0;
}

class TransformsReader {
 public:
  explicit TransformsReader(const fs::path& file) : file_(file) {}

  ImportedPoses Read() {
    root_ = json::parse(ReadTextFile(file_), nullptr, false);
    if (!root_.is_object()) Fail("not a JSON object");
    const auto frames = root_.find("frames");
    if (frames == root_.end() || !frames->is_array()) Fail("no list of frames");
    ReadAppliedTransform();
    const std::set<std::string> tests = TestNames();
    poses_.source = file_;
    for (const json& frame : *frames) {
      where_ = "frame " + std::to_string(poses_.images.size());
      ReadFrame(frame, tests);
    }
    return std::move(poses_);
  }

 private:
  [[noreturn]] void Fail(const std::string& cause) const {
    throw ToolError(file_.string() + ": " + (where_.empty() ? cause : where_ + ": " + cause));
  }

  double Number(const json& value, const char* what) const {
    if (!value.is_number() || !std::isfinite(value.get<double>())) {
      Fail(std::string(what) + " is not a number");
    }
    return value.get<double>();
  }

  // The first three rows of a 3x4 or 4x4 matrix.
  Eigen::Matrix<double, 3, 4> Matrix(const json& rows, const char* what) const {
    const bool is_matrix = rows.is_array() && (rows.size() == 3 || rows.size() == 4) &&
                           std::all_of(rows.begin(), rows.end(), [](const json& row) {
                             return row.is_array() && row.size() == 4;
                           });
    if (!is_matrix) Fail(std::string(what) + " is not a 3x4 or 4x4 matrix");
    Eigen::Matrix<double, 3, 4> m;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 4; ++c) m(r, c) = Number(rows[r][c], what);
    }
    if (!IsRotation(m.leftCols<3>())) Fail(std::string(what) + " is not a rotation");
    if (m.col(3).cwiseAbs().maxCoeff() > kMaxCoordinate) {
      Fail(std::string(what) + " is more than 1e9 from the origin");
    }
    return m;
  }

  void ReadAppliedTransform() {
    if (root_.contains("applied_transform")) {
      applied_ = Matrix(root_["applied_transform"], "applied_transform");
    }
    if (root_.contains("applied_scale")) {
      scale_ = Number(root_["applied_scale"], "applied_scale");
      if (!(scale_ > 0)) Fail("applied_scale is not positive");
    }
  }

  std::set<std::string> TestNames() const {
    std::set<std::string> names;
    for (const char* key : {"test_filenames", "val_filenames"}) {
      const auto list = root_.find(key);
      if (list == root_.end() || !list->is_array()) continue;
      for (const json& name : *list) {
        if (name.is_string()) names.insert(name.get<std::string>());
      }
    }
    return names;
  }

  void ReadFrame(const json& frame, const std::set<std::string>& tests) {
    if (!frame.is_object() || !frame.contains("file_path") || !frame["file_path"].is_string()) {
      Fail("no file_path");
    }
    ImportedPose image;
    image.name = frame["file_path"].get<std::string>();
    if (image.name.empty()) Fail("file_path is empty");
    image.is_test = tests.contains(image.name);
    if (!frame.contains("transform_matrix")) Fail("no transform_matrix");
    image.pose = PoseOf(Matrix(frame["transform_matrix"], "transform_matrix"));
    image.camera_idx = CameraIndex(frame);
    poses_.images.push_back(std::move(image));
  }

  // given = scale * applied * original, in OpenGL's camera axes.
  Pose PoseOf(const Eigen::Matrix<double, 3, 4>& given) const {
    const Eigen::Matrix3d world_from_given = applied_.leftCols<3>().transpose();
    const Eigen::Matrix3d gl_from_cam = Eigen::Vector3d(1, -1, -1).asDiagonal();
    Pose pose;
    pose.world_from_cam =
        Eigen::Quaterniond(world_from_given * given.leftCols<3>() * gl_from_cam).normalized();
    pose.cam_in_world = world_from_given * (given.col(3) / scale_ - applied_.col(3));
    return pose;
  }

  // Null: neither the frame nor the file says it.
  const json* Find(const json& frame, const char* key) const {
    if (frame.contains(key)) return &frame[key];
    return root_.contains(key) ? &root_[key] : nullptr;
  }

  double Value(const json& frame, const char* key, double otherwise) const {
    const json* value = Find(frame, key);
    return value == nullptr ? otherwise : Number(*value, key);
  }

  int CameraIndex(const json& frame) {
    const bool has_focal_length = Find(frame, "fl_x") != nullptr;
    if (!has_focal_length && Find(frame, "camera_angle_x") == nullptr) return -1;
    Camera camera;
    camera.width = ReadSide(frame, "w");
    camera.height = ReadSide(frame, "h");
    camera.fx = has_focal_length
                    ? Value(frame, "fl_x", 0)
                    : camera.width / (2 * std::tan(Value(frame, "camera_angle_x", 0) / 2));
    camera.fy = Value(frame, "fl_y", camera.fx);
    if (!(camera.fx > 0 && camera.fy > 0)) Fail("a focal length is not positive");
    const Eigen::Vector2d centre = FromColmapPixel(
        {Value(frame, "cx", camera.width / 2.0), Value(frame, "cy", camera.height / 2.0)});
    camera.cx = centre.x();
    camera.cy = centre.y();
    ReadDistortion(frame, camera);
    const auto known = std::find(cameras_.begin(), cameras_.end(), camera);
    if (known != cameras_.end()) return static_cast<int>(known - cameras_.begin());
    cameras_.push_back(camera);
    poses_.cameras.push_back(ToCalibration(camera));
    return static_cast<int>(cameras_.size()) - 1;
  }

  int ReadSide(const json& frame, const char* key) const {
    const double side = Value(frame, key, 0);
    if (!(side >= 1 && side <= kMaxSide)) Fail(std::string("no image size ") + key);
    return static_cast<int>(side);
  }

  void ReadDistortion(const json& frame, Camera& camera) const {
    const json* model = Find(frame, "camera_model");
    const std::string name =
        model != nullptr && model->is_string() ? model->get<std::string>() : "OPENCV";
    const json* flag = Find(frame, "is_fisheye");
    const bool is_fisheye =
        name == "OPENCV_FISHEYE" || (flag != nullptr && flag->is_boolean() && flag->get<bool>());
    const auto value = [&](const char* key) { return Value(frame, key, 0); };
    if (is_fisheye) {
      camera.model = CameraModel::kKannalaBrandt;
      camera.distortion = {value("k1"), value("k2"), value("k3"), value("k4")};
      return;
    }
    if (name != "OPENCV" && name != "PINHOLE" && name != "SIMPLE_PINHOLE" &&
        name != "SIMPLE_RADIAL" && name != "RADIAL") {
      Fail("camera_model " + name + " is not supported");
    }
    // There k4 multiplies r^8, which Brown-Conrady in OpenCV's form does not have.
    if (value("k4") != 0) Fail("k4 of an OPENCV camera is not supported");
    camera.distortion = {value("k1"), value("k2"), value("p1"), value("p2"), value("k3")};
    const bool is_pinhole = std::all_of(camera.distortion.begin(), camera.distortion.end(),
                                        [](double k) { return k == 0; });
    camera.model = is_pinhole ? CameraModel::kPinhole : CameraModel::kBrownConrady;
  }

  fs::path file_;
  std::string where_;
  json root_;
  Eigen::Matrix<double, 3, 4> applied_ = Eigen::Matrix<double, 3, 4>::Identity();
  double scale_ = 1;
  std::vector<Camera> cameras_;
  ImportedPoses poses_;
};

}  // namespace

ImportedPoses ReadTransformsJson(const fs::path& file) { return TransformsReader(file).Read(); }

}  // namespace viewfix
