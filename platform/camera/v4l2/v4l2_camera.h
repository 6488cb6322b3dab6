// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "platform/camera/frame_source.h"
#include "platform/camera/v4l2/v4l2_system.h"
#include "platform/clock.h"

namespace viewfix {

// A camera of the kernel's video interface, as MakeLiveCamera() keeps it: the same physical one
// under whatever node, with its controls. `system` must outlive it.
std::unique_ptr<FrameSource> MakeV4l2Camera(V4l2System& system, const CameraSettings& settings,
                                            std::function<std::int64_t()> asleep_ns = SleptNs);

// What `viewfixd cameras` prints: the machine's cameras with formats, sizes, rates and controls;
// empty: none.
std::string DescribeCameras(V4l2System& system);

}  // namespace viewfix
