// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "platform/camera/frame_source.h"

namespace viewfix {

// A camera that needs libcamera's pipelines, such as a CSI sensor with an image signal processor,
// as MakeLiveCamera() keeps it. One a process. kUnsupported: this build has no libcamera.
Result<std::unique_ptr<FrameSource>> MakeLibcameraCamera(const CameraSettings& settings);

// What `viewfixd cameras` prints of libcamera's cameras; empty: none.
std::string DescribeLibcameraCameras();

}  // namespace viewfix
