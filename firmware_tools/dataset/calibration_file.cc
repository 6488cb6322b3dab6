// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/dataset/calibration_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <string>

#include "firmware_tools/dataset/tool_file.h"

namespace viewfix {
namespace {

constexpr std::size_t kMaxCalibrationBytes = 1 << 20;

[[noreturn]] void Fail(const std::filesystem::path& file, const std::string& cause) {
  throw ToolError("calibration " + file.string() + ": " + cause);
}

cv::FileStorage Open(const std::filesystem::path& file) {
  const std::string text = ReadTextFile(file);
  if (text.size() > kMaxCalibrationBytes) Fail(file, "too large for a calibration");
  if (text.find('\0') != std::string::npos) Fail(file, "not a text file");
  try {
    cv::FileStorage storage(text, cv::FileStorage::READ | cv::FileStorage::MEMORY);
    if (storage.isOpened() && storage.root().isMap()) return storage;
  } catch (const cv::Exception&) {  // its text names OpenCV's source lines, not the file's
  }
  Fail(file, "not in OpenCV's YAML, XML or JSON format");
}

cv::Mat ReadMatrix(const cv::FileStorage& storage, const char* key,
                   const std::filesystem::path& file) {
  cv::Mat matrix;
  try {
    storage[key] >> matrix;
    if (matrix.channels() == 1) matrix.convertTo(matrix, CV_64F);
  } catch (const cv::Exception&) {
    Fail(file, std::string(key) + " is not a matrix");
  }
  if (matrix.channels() != 1) Fail(file, std::string(key) + " is not a matrix");
  if (!matrix.empty() && !cv::checkRange(matrix)) {
    Fail(file, std::string(key) + " holds a number that is not finite");
  }
  return matrix;
}

int ReadSide(const cv::FileStorage& storage, const char* key, const std::filesystem::path& file) {
  const cv::FileNode node = storage[key];
  if (!node.isInt()) Fail(file, std::string("no whole number ") + key);
  const int side = static_cast<int>(node);
  if (side <= 0) Fail(file, std::string(key) + " is not positive");
  return side;
}

void ReadCameraMatrix(const cv::FileStorage& storage, const std::filesystem::path& file,
                      Calibration& calibration) {
  const cv::Mat k = ReadMatrix(storage, "camera_matrix", file);
  if (k.rows != 3 || k.cols != 3) Fail(file, "no 3x3 camera_matrix");
  const auto at = [&](int row, int col) { return k.at<double>(row, col); };
  if (at(0, 1) != 0 || at(1, 0) != 0 || at(2, 0) != 0 || at(2, 1) != 0 || at(2, 2) != 1) {
    Fail(file, "camera_matrix is not of the form [fx 0 cx; 0 fy cy; 0 0 1]");
  }
  calibration.fx = at(0, 0);
  calibration.fy = at(1, 1);
  calibration.cx = at(0, 2);
  calibration.cy = at(1, 2);
  if (!(calibration.fx > 0 && calibration.fy > 0)) Fail(file, "a focal length is not positive");
}

}  // namespace

Calibration LoadCalibration(const std::filesystem::path& file) {
  const cv::FileStorage storage = Open(file);
  Calibration calibration;
  calibration.width = ReadSide(storage, "image_width", file);
  calibration.height = ReadSide(storage, "image_height", file);
  ReadCameraMatrix(storage, file, calibration);
  const cv::Mat distortion = ReadMatrix(storage, "distortion_coefficients", file);
  constexpr std::array<std::size_t, 6> kSizes = {0, 4, 5, 8, 12, 14};
  if (std::find(kSizes.begin(), kSizes.end(), distortion.total()) == kSizes.end()) {
    Fail(file, "distortion_coefficients are not 4, 5, 8, 12 or 14 numbers");
  }
  if (!distortion.empty()) {  // an empty matrix has no iterators
    calibration.distortion.assign(distortion.begin<double>(), distortion.end<double>());
  }
  return calibration;
}

void SaveCalibration(const Calibration& calibration, const std::filesystem::path& file) {
  cv::FileStorage storage(".yaml", cv::FileStorage::WRITE | cv::FileStorage::MEMORY);
  storage << "image_width" << calibration.width << "image_height" << calibration.height;
  storage << "camera_matrix"
          << cv::Mat(cv::Matx33d(calibration.fx, 0, calibration.cx, 0, calibration.fy,
                                 calibration.cy, 0, 0, 1));
  if (!calibration.distortion.empty()) {
    storage << "distortion_coefficients" << cv::Mat(calibration.distortion, true).reshape(1, 1);
  }
  WriteTextFile(file, storage.releaseAndGetString());
}

}  // namespace viewfix
