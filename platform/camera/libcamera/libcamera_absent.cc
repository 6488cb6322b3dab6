// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/libcamera/libcamera_camera.h"

namespace viewfix {

Result<std::unique_ptr<FrameSource>> MakeLibcameraCamera(const CameraSettings& settings) {
  return Status(StatusCode::kUnsupported, "this build has no libcamera",
                "libcamera:" + settings.where);
}

std::string DescribeLibcameraCameras() { return {}; }

}  // namespace viewfix
