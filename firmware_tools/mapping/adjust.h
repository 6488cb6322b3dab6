// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "firmware_tools/mapping/reconstruction.h"

namespace viewfix {

struct AdjustOptions {
  bool poses = false;  // else only points move
  bool focal = false;  // one factor on fx and fy of each camera
  // One readout of each camera's rolling shutter, within one frame (rolling_shutter.h): key points
  // are moved to where the middle row's pose sees them. MapImage::motion must be set.
  bool readout = false;
  // How sure the poses that came in are; they keep the frame. 0: not held to them at all,
  // the frame then is that of the first image.
  double position_sigma = 0;  // world units
  double rotation_sigma_deg = 0.5;
  // Beyond this, errors count less (Cauchy); of an image of 640 pixels a side.
  double loss_px = 1.0;
  int max_iterations = 30;
  double function_tolerance = 1e-5;  // of the cost, relative
};

struct AdjustReport {
  int iterations = 0;
  bool converged = false;
  double initial_cost = 0;
  double final_cost = 0;
};

// Bundle adjustment: minimizes the robust reprojection errors of all tracks over points and, as
// the options say, poses and focal lengths (Ceres, sparse Schur complement, one thread so that
// the result is the same on every run). Updates MapPoint::error_px.
AdjustReport Adjust(Reconstruction& map, const AdjustOptions& options);

// Sets MapPoint::error_px of all points.
void UpdateErrors(Reconstruction& map);

}  // namespace viewfix
