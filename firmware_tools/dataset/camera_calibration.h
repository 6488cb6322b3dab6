// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "firmware_tools/common/parallel.h"
#include "firmware_tools/dataset/charuco.h"
#include "firmware_tools/dataset/image_set.h"

namespace viewfix {

// The boards seen in photographs (an image set, or a folder of images) or in a video.
struct BoardViews {
  int width = 0, height = 0;  // pixels, of every image
  std::vector<BoardView> views;
  int images = 0;  // looked at
};

// Of a video, frames in which the board has moved, evenly spread, at most 80. Throws ToolError:
// nothing to read, images of different sizes.
BoardViews FindBoards(const std::filesystem::path& source, const CharucoSpec& spec,
                      const Progress& report);

struct CalibratedView {
  std::string name;
  int corners = 0;
  double rms_px = 0;  // under the final calibration; 0 where it was not used
  bool is_used = false;
};

struct CameraCalibration {
  Calibration calibration;
  double rms_px = 0;  // over the corners used
  double focal_sigma_share =
      0;                // standard deviation of fx as a share of it; 0: not known (fisheye)
  double coverage = 0;  // share of 6 x 4 cells of the image that hold a corner
  std::vector<CalibratedView> views;  // in the order of the boards
};

// Calibrates a camera: kBrownConrady (k1 k2 p1 p2 k3, as cv::calibrateCamera) or kKannalaBrandt
// (cv::fisheye::calibrate). Views of fewer than 8 corners are not used; views that fit worse than
// 2.5 times the median are dropped. Throws ToolError saying what to photograph: fewer than 6
// usable views, corners in fewer than half of the cells, the board always held alike (planes
// within 15 degrees), or a Brown-Conrady focal length known no better than to 1 %.
CameraCalibration CalibrateCamera(const BoardViews& boards, const CharucoSpec& spec,
                                  CameraModel model);

}  // namespace viewfix
