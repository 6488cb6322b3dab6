// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "platform/camera/frame_source.h"
#include "platform/camera/v4l2/v4l2_stream.h"
#include "platform/camera/v4l2/v4l2_system.h"

namespace viewfix {

// A camera of the kernel's video interface, for as long as the program runs: opened when it is
// there, looked for again when it was unplugged, started anew when it fails. `system` must
// outlive it.
std::unique_ptr<FrameSource> MakeV4l2Camera(V4l2System& system, const CameraSettings& settings);

// What `viewfixd cameras` prints: the machine's cameras with formats, sizes, rates and controls.
std::string DescribeCameras(V4l2System& system);

}  // namespace viewfix
