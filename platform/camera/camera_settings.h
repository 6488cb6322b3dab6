// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace viewfix {

// A control of a camera and the value that it is set to and kept at.
struct CameraControl {
  std::string name;  // as `viewfixd cameras` shows it: exposure_time_absolute
  std::int64_t value = 0;

  friend bool operator==(const CameraControl&, const CameraControl&) = default;
};

// Which camera, and what is asked of it.
struct CameraSettings {
  enum class Kind { kNone, kReplay, kV4l2, kLibcamera };

  Kind kind = Kind::kNone;
  // Folder, list of images or video (replay); node, by-id name or card name (v4l2); part of the
  // id or the model (libcamera).
  std::string where;
  // Live cameras; the nearest that the camera has is taken, and said.
  int width = 640;  // pixels
  int height = 480;
  double rate = 0;  // frames a second; 0: the camera's own, and 10 for a replay in real time
  std::string pixel_format;  // four characters, YUYV; empty: the best there is
  std::vector<CameraControl> controls;
  // Replay alone.
  bool real_time = false;  // frames come at `rate`, and those that nobody has time for are lost
  bool loop = false;       // from the start again when it has ended

  friend bool operator==(const CameraSettings&, const CameraSettings&) = default;
};

}  // namespace viewfix
