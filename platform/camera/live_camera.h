// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "platform/camera/frame_source.h"
#include "platform/camera/raw_image.h"

namespace viewfix {

// A camera that streams, by whatever interface: open until it breaks. Stops at its end.
class CameraStream {
 public:
  struct Buffer {
    RawImage image;  // in the driver's memory, until Return()
    std::uint32_t index = 0;
    std::uint32_t sequence = 0;  // the driver's count
    std::int64_t time_ns = 0;    // CLOCK_MONOTONIC; 0: the driver's clock is another
    bool erroneous = false;      // flagged as damaged
  };
  enum class Dequeued { kBuffer, kNone, kBroken };

  virtual ~CameraStream() = default;
  // "640x480 YUYV at 30/s, ...": what it was set to.
  virtual std::string text() const = 0;
  // Waits for a buffer, or for `wake_fd`. Events of poll(2) of the device; 0: time is over, or
  // woken; -1: broken.
  virtual int Wait(int wake_fd, int timeout_ms) = 0;
  // A filled buffer, without waiting. kBroken: the stream has to be started anew.
  virtual Dequeued Dequeue(Buffer& buffer) = 0;
  // Gives a buffer back to the driver. False: broken.
  virtual bool Return(const Buffer& buffer) = 0;
  // Why it is broken.
  virtual const Status& fault() const = 0;
};

// Finds the camera and starts it; the same camera where it was found before. `remarks`: what was
// asked for and not to be had, one line each.
using StreamOpener =
    std::function<Result<std::unique_ptr<CameraStream>>(std::vector<std::string>& remarks)>;

// Remarks that format and size are not those asked for, where they are not.
void RemarkFormat(const CameraSettings& settings, const std::string& pixel_format, int width,
                  int height, std::vector<std::string>& remarks);

// A camera for as long as the program runs: opened when it is there, looked for again when it was
// unplugged, started anew when it fails, falls silent, or the machine was asleep.
// `asleep_ns`: how long the machine has slept since it started; SleptNs() but in tests.
std::unique_ptr<FrameSource> MakeLiveCamera(StreamOpener open, const CameraSettings& settings,
                                            std::function<std::int64_t()> asleep_ns);

}  // namespace viewfix
