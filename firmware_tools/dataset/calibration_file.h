// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>

#include "engine/geometry/camera.h"
#include "firmware_tools/dataset/image_set.h"
#include "platform/camera/jpeg_decoder.h"

namespace viewfix {

// A calibration in OpenCV's or ROS's YAML, read by the board's own reader
// (platform/camera/calibration.h says what it takes). Throws ToolError naming the file and the
// cause: unreadable, a field missing, a size that is not positive, a focal length that is not
// positive, a number that is not finite.
Calibration LoadCalibration(const std::filesystem::path& file);

// The same as OpenCV YAML, every number exact; a fisheye says so by `distortion_model`. Atomic.
void SaveCalibration(const Calibration& calibration, const std::filesystem::path& file);

// The camera that a calibration describes. At most 8 distortion coefficients are taken; nothing
// is checked.
Camera ToCamera(const Calibration& calibration);

// With the coefficients that the camera uses: 0, 4, 5 or 8.
Calibration ToCalibration(const Camera& camera);

// What the EXIF block tells of the camera that took a width x height image: a pinhole of focal
// length focal_length_35mm / 36 mm * the longer side, its centre in the image's. Off by a few per
// cent (zoom, cropping, distortion): a beginning, not a calibration. Nothing: the block is silent.
std::optional<Calibration> CalibrationFromExif(const ExifInfo& exif, int width, int height);

// The camera of an image of width x height pixels: the set's, where it has one, else EXIF's.
std::optional<Calibration> CalibrationOf(const ImageSet& set, const ImageRecord& image,
                                         const ExifInfo& exif, int width, int height);

}  // namespace viewfix
