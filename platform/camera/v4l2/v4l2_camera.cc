// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/v4l2/v4l2_camera.h"

#include <optional>
#include <utility>
#include <vector>

#include "platform/camera/live_camera.h"
#include "platform/camera/v4l2/v4l2_stream.h"

namespace viewfix {

std::unique_ptr<FrameSource> MakeV4l2Camera(V4l2System& system, const CameraSettings& settings,
                                            std::function<std::int64_t()> asleep_ns) {
  auto open =
      [&system, settings, identity = std::optional<CameraIdentity>()](
          std::vector<std::string>& remarks) mutable -> Result<std::unique_ptr<CameraStream>> {
    Result<V4l2Node> node = FindCamera(system, settings.where, identity);
    if (!node.ok()) return node.status();
    CameraIdentity found = node->identity();
    Result<std::unique_ptr<V4l2Stream>> stream =
        V4l2Stream::Start(std::move(*node), settings, remarks);
    if (!stream.ok()) return stream.status();
    identity = std::move(found);
    return std::unique_ptr<CameraStream>(std::move(*stream));
  };
  return MakeLiveCamera(std::move(open), settings, std::move(asleep_ns));
}

}  // namespace viewfix
