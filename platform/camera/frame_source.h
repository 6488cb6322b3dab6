// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "engine/base/status.h"
#include "platform/camera/jpeg_decoder.h"

namespace viewfix {

struct Frame {
  std::uint64_t sequence = 0;        // counts from 0, gaps are frames lost
  std::int64_t capture_time_ns = 0;  // CLOCK_MONOTONIC
  std::string name;                  // file name (replay), else empty
  GreyImage image;
};

// Where frames come from: a camera, or files that stand in for one.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  // Fills `frame` with the next one. kNotFound: the source has ended. Other
  // errors concern this frame alone; the next call goes on.
  virtual Status Next(Frame& frame) = 0;
};

// Replays a folder's *.jpg / *.jpeg in name order (searched recursively), or, if
// the folder holds images.csv, the files of its `path` column in row order.
Result<std::unique_ptr<FrameSource>> OpenReplay(const std::string& folder);

}  // namespace viewfix
