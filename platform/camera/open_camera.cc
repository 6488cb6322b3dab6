// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/frame_source.h"

namespace viewfix {

Result<std::unique_ptr<FrameSource>> OpenCamera(const CameraSettings& settings) {
  switch (settings.kind) {
    case CameraSettings::Kind::kReplay:
      return OpenReplay(settings);
    default:
      return Status(StatusCode::kUnsupported, "this build has no such camera", settings.where);
  }
}

}  // namespace viewfix
