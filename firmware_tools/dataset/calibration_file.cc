// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/dataset/calibration_file.h"

#include <algorithm>
#include <cstddef>
#include <string>

#include "firmware_tools/dataset/text_fields.h"
#include "firmware_tools/dataset/tool_file.h"
#include "platform/camera/calibration.h"

namespace viewfix {
namespace {

constexpr double kFilmWidthMm = 36;

std::size_t CoefficientsInUse(const Camera& camera) {
  if (camera.model == CameraModel::kPinhole) return 0;
  if (camera.model == CameraModel::kKannalaBrandt) return 4;
  const auto last = std::find_if(camera.distortion.rbegin(), camera.distortion.rend(),
                                 [](double k) { return k != 0; });
  const std::ptrdiff_t used = camera.distortion.rend() - last;
  return used <= 4 ? 4 : used == 5 ? 5 : 8;
}

std::string MatrixText(const char* name, int rows, const std::vector<double>& data) {
  std::string text = name;
  text.append(": !!opencv-matrix\n   rows: ").append(std::to_string(rows));
  text.append("\n   cols: ").append(std::to_string(data.size() / rows));
  text.append("\n   dt: d\n   data: [");
  for (std::size_t i = 0; i < data.size(); ++i) {
    text.append(i == 0 ? " " : ", ").append(ExactNumber(data[i]));
  }
  return text.append(" ]\n");
}

}  // namespace

Calibration LoadCalibration(const std::filesystem::path& file) {
  const std::string text = ReadTextFile(file);
  const Result<Camera> camera = ParseCalibration(text);
  if (!camera.ok()) {
    throw ToolError("calibration " + file.string() + ": " + Describe(camera.status()));
  }
  return ToCalibration(*camera);
}

void SaveCalibration(const Calibration& calibration, const std::filesystem::path& file) {
  std::string text = "%YAML:1.0\n---\nimage_width: ";
  text.append(std::to_string(calibration.width)).append("\nimage_height: ");
  text.append(std::to_string(calibration.height)).append("\n");
  text +=
      MatrixText("camera_matrix", 3,
                 {calibration.fx, 0, calibration.cx, 0, calibration.fy, calibration.cy, 0, 0, 1});
  if (calibration.model == CameraModel::kKannalaBrandt) text += "distortion_model: equidistant\n";
  if (!calibration.distortion.empty()) {
    text += MatrixText("distortion_coefficients", 1, calibration.distortion);
  }
  WriteTextFile(file, text);
}

Camera ToCamera(const Calibration& from) {
  Camera camera{from.model, from.width, from.height, from.fx, from.fy, from.cx, from.cy, {}};
  const std::size_t count = std::min(from.distortion.size(), camera.distortion.size());
  std::copy_n(from.distortion.begin(), count, camera.distortion.begin());
  return camera;
}

Calibration ToCalibration(const Camera& from) {
  Calibration to{from.width, from.height, from.fx, from.fy, from.cx, from.cy, {}, from.model};
  to.distortion.assign(from.distortion.begin(),
                       from.distortion.begin() + std::ptrdiff_t(CoefficientsInUse(from)));
  return to;
}

std::optional<Calibration> CalibrationFromExif(const ExifInfo& exif, int width, int height) {
  if (!exif.focal_length_35mm || !(*exif.focal_length_35mm > 0)) return std::nullopt;
  Calibration calibration;
  calibration.width = width;
  calibration.height = height;
  calibration.fx = calibration.fy =
      *exif.focal_length_35mm / kFilmWidthMm * std::max(width, height);
  calibration.cx = (width - 1) / 2.0;
  calibration.cy = (height - 1) / 2.0;
  calibration.model = CameraModel::kPinhole;
  return calibration;
}

std::optional<Calibration> CalibrationOf(const ImageSet& set, const ImageRecord& image,
                                         const ExifInfo& exif, int width, int height) {
  if (image.camera_idx >= 0) return set.cameras.at(image.camera_idx);
  return CalibrationFromExif(exif, width, height);
}

}  // namespace viewfix
