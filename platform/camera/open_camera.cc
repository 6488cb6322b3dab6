// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/frame_source.h"
#include "platform/camera/libcamera/libcamera_camera.h"
#include "platform/camera/v4l2/v4l2_camera.h"

namespace viewfix {

Result<std::unique_ptr<FrameSource>> OpenCamera(const CameraSettings& settings) {
  switch (settings.kind) {
    case CameraSettings::Kind::kReplay:
      return OpenReplay(settings);
    case CameraSettings::Kind::kV4l2:
      return MakeV4l2Camera(RealV4l2System(), settings);
    case CameraSettings::Kind::kLibcamera:
      return MakeLibcameraCamera(settings);
    default:
      return Status(StatusCode::kUnsupported, "this build has no such camera", settings.where);
  }
}

}  // namespace viewfix
