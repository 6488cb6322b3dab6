// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

#include "engine/localizer.h"
#include "engine/pose/motion_model.h"
#include "platform/camera/frame_source.h"
#include "platform/daemon/model_holder.h"

namespace viewfix {

// From a frame to its JSON line: turned upright, looked for first where the frames before it
// lead, compared with them. One instance serves one stream.
class FrameAnswerer {
 public:
  // Turns frame.image as `model` says. `number`: of the frame as the motion counts (pipeline.cc).
  // Errors concern this frame: the detail names it, its size and its camera's.
  Result<Fix> Localize(Frame& frame, std::uint64_t number, LoadedModel& model);

 private:
  MotionModel motion_;
  YuvImage turned_;
};

// The line of a fix; valid until the model's next.
std::string_view WriteFix(const Frame& frame, const Fix& fix, LoadedModel& model);

}  // namespace viewfix
