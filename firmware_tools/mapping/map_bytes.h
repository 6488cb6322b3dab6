// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "engine/geometry/camera.h"
#include "engine/geometry/rigid3.h"
#include "firmware_tools/common/stage_cache.h"

namespace viewfix {

// Cameras and poses in the keys and files of what is kept from run to run.

void HashCamera(const Camera& camera, ContentHash& hash);
void HashPose(const Rigid3& pose, ContentHash& hash);
void SavePose(const Rigid3& pose, ByteWriter& writer);
void LoadPose(ByteReader& reader, Rigid3& pose);

}  // namespace viewfix
