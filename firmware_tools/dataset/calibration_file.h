// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>

#include "firmware_tools/dataset/image_set.h"

namespace viewfix {

// A calibration in OpenCV's format (YAML, XML or JSON): image_width, image_height,
// camera_matrix (3x3, no skew) and, optional, distortion_coefficients (0, 4, 5, 8 or 12
// numbers). Throws ToolError naming the file and the cause: unreadable, a field missing, a size
// that is not positive, a focal length that is not positive, a number that is not finite.
Calibration LoadCalibration(const std::filesystem::path& file);

// The same as OpenCV YAML, every number exact. Atomic.
void SaveCalibration(const Calibration& calibration, const std::filesystem::path& file);

}  // namespace viewfix
