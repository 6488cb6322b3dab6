// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

#include "engine/base/status.h"
#include "engine/geometry/camera.h"

namespace viewfix {

// A camera from the text of a calibration file, as OpenCV's calibration or ROS's camera_info has
// it: image_width, image_height, camera_matrix (3x3, no skew) and, optional,
// distortion_coefficients: 0, 4, 5, 8, 12 or 14 numbers in OpenCV's order, those behind the eighth
// zero. They are Brown-Conrady's unless `distortion_model: equidistant` (or `fisheye`), or
// `fisheye_model: 1`, makes 4 of them Kannala-Brandt's; plumb_bob and rational_polynomial are
// Brown-Conrady's too. Brown-Conrady with nothing but zeros is a pinhole.
//
// Of YAML it knows what these programs write: `key: value` lines, one level of maps below them
// (indented, or in braces) and lists (in brackets over any number of lines, or with dashes).
// kCorrupt or kUnsupported, the detail naming line or key: anything else, a field missing, a key
// given twice, a size or focal length that is not positive, a number that is not finite.
Result<Camera> ParseCalibration(std::string_view text);

// The same from a file; the error's detail names it.
Result<Camera> ReadCalibration(const std::string& path);

}  // namespace viewfix
