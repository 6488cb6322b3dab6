// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "engine/base/status.h"
#include "platform/camera/camera_settings.h"
#include "platform/camera/jpeg_decoder.h"

namespace viewfix {

struct Frame {
  std::uint64_t sequence = 0;        // counts from 0, gaps are frames lost
  std::int64_t capture_time_ns = 0;  // CLOCK_MONOTONIC
  std::string name;                  // file name (replay), else empty
  YuvImage image;
};

// What became of the frames of a live camera since the start.
struct CameraCounts {
  std::uint64_t delivered = 0;   // handed on
  std::uint64_t skipped = 0;     // older than the newest, or not asked for: never decoded
  std::uint64_t erroneous = 0;   // flagged by the driver as damaged
  std::uint64_t truncated = 0;   // too few bytes, or a JPEG that does not decode
  std::uint64_t lost = 0;        // gaps in the driver's own count
  std::uint64_t timeouts = 0;    // waits that ended without a frame
  std::uint64_t reconnects = 0;  // times that it was opened again
};

// Whether a camera is there, in words for people.
struct CameraCondition {
  bool present = true;
  std::string text;  // "640x480 YUYV at 30/s", or why there is none
};

// Where frames come from: a camera, or files that stand in for one. Used by one thread; Wake()
// alone may be called by another.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  // Fills `frame` with the next one. kNotFound: the source has ended. kCancelled: no frame
  // came in time (a second at most), or Wake() was called; condition() says more. Other errors
  // concern this frame alone; the next call goes on.
  virtual Status Next(Frame& frame) = 0;
  // Frames come whether or not anybody has time for them.
  virtual bool live() const { return false; }
  // Frames that come sooner after the last one handed on need not be decoded.
  virtual void SetMinInterval(std::int64_t) {}
  // Ends a Next() that waits.
  virtual void Wake() {}
  virtual CameraCondition condition() const { return {}; }
  virtual CameraCounts counts() const { return {}; }
};

// Replays a folder's *.jpg / *.jpeg in name order (searched recursively), or, if
// the folder holds images.csv, the files of its `path` column in row order. A file is a list of
// images, relative to its own folder (*.csv: such a table; *.txt: a path a line), else a video.
Result<std::unique_ptr<FrameSource>> OpenReplay(const CameraSettings& settings);
// Every frame once, at full speed.
Result<std::unique_ptr<FrameSource>> OpenReplay(const std::string& folder);

// The source that the settings name. A camera that is not there is no error: it may come.
Result<std::unique_ptr<FrameSource>> OpenCamera(const CameraSettings& settings);

}  // namespace viewfix
