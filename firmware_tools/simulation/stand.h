// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/simulation/random.h"
#include "firmware_tools/simulation/room.h"

namespace viewfix::simulation {

// Where a camera stands in its room and how it is held.
struct Stand {
  Eigen::Vector3d position;
  double heading = 0;  // of the viewing direction in the floor plane
  double pitch = 0;    // > 0 looks down
  double roll = 0;     // about the viewing direction, clockwise as seen by the camera
};

// Its pose in the frame of the room.
Pose PoseOf(const Stand& stand);

// The unit vector at `angle` in the floor plane.
Eigen::Vector3f Heading(double angle);

// The first free stand near the wished distance, coming closer to the middle of the approach
// if none is free. Throws ToolError if that has no free place either.
Stand FreeStand(const Room& room, const Approach& approach, double distance, Random& random);

}  // namespace viewfix::simulation
