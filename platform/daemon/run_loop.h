// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <csignal>
#include <cstdint>

#include "engine/fix_filter.h"
#include "engine/localizer.h"
#include "platform/camera/frame_source.h"
#include "platform/publish/fix_writer.h"
#include "platform/publish/publisher.h"

namespace viewfix {

struct RunReport {
  std::uint64_t frames = 0;  // that have their line in the output
  std::uint64_t localized = 0;
  std::uint64_t failed = 0;  // that could not be used: each has its line on stderr
};

// Frame after frame: read, turn upright, localize, publish; until the source ends or `stop`
// is set. A frame that cannot be read, or whose shape is not its camera's, is reported by name on
// stderr and passed over: others of a replay may do. Returns why publishing is impossible
// (kCancelled: the reader of the output is gone), else ok.
// `camera`: of the frames once upright; null: the model's own. A frame is first looked for where
// the frames before it lead. `filter`: null: each frame is judged alone.
Status RunLoop(FrameSource& source, int rotate_deg, const Camera* camera, Localizer& localizer,
               FixFilter* filter, FixWriter& writer, Publisher& publisher,
               const volatile std::sig_atomic_t& stop, RunReport& report);

// "text: detail" on stderr, after the program's name: one line.
void PrintFault(const Status& status);

}  // namespace viewfix
