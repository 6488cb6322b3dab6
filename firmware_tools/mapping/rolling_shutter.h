// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include "firmware_tools/mapping/map_input.h"
#include "firmware_tools/mapping/reconstruction.h"

namespace viewfix {

// Cameras that expose one row after another see a bent picture while they move, and a map made of
// such pictures is bent as well. Here a frame moves as its neighbours in the walk say, evenly, and
// the time between its first and last row (the readout, in units of the time between two frames)
// is one number a camera, which Adjust() estimates (Hedborg et al., Rolling shutter bundle
// adjustment, CVPR 2012, with the motion taken from the neighbours' poses).

// Rows before (negative) or after the middle one, in picture heights.
inline double RowOffset(const Camera& camera, double y) {
  return (y - 0.5 * (camera.height - 1)) / camera.height;
}

// Sets MapImage::motion from the poses of the frames before and after in the walk; zero where
// they are too far away to tell. The map's images are the input's frames with a pose, in order.
void SetMotions(const MapInput& input, Reconstruction& map);

// Moves key points to where the middle row's pose would have seen them, and tells so in
// MapImage::readout. A key point without a point is taken to be at its image's median depth.
//   readouts  [cameras]
void Unroll(std::span<const double> readouts, Reconstruction& map);

}  // namespace viewfix
