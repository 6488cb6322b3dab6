// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "platform/camera/camera_settings.h"
#include "platform/camera/v4l2/to_grey.h"
#include "platform/camera/v4l2/v4l2_node.h"

namespace viewfix {

// What a camera was set to.
struct StreamFormat {
  std::uint32_t fourcc = 0;
  int width = 0, height = 0;
  std::size_t row_bytes = 0;
  bool limited_range = false;
  double rate = 0;  // frames a second; 0: the driver does not tell
};

// A node that streams into buffers of its own memory: format, rate, controls, buffers. Stops and
// gives its memory back at the end.
class V4l2Stream {
 public:
  struct Buffer {
    RawImage image;  // in the driver's memory, until Return()
    std::uint32_t index = 0;
    std::uint32_t sequence = 0;  // the driver's count
    std::int64_t time_ns = 0;    // CLOCK_MONOTONIC; 0: the driver's clock is another
    bool erroneous = false;      // flagged as damaged
  };
  enum class Dequeued { kBuffer, kNone, kBroken };

  // `remarks`: what was asked for and not to be had, one line each.
  static Result<std::unique_ptr<V4l2Stream>> Start(V4l2Node node, const CameraSettings& settings,
                                                   std::vector<std::string>& remarks);
  ~V4l2Stream();
  V4l2Stream(const V4l2Stream&) = delete;
  V4l2Stream& operator=(const V4l2Stream&) = delete;

  const V4l2Node& node() const { return node_; }
  const StreamFormat& format() const { return format_; }

  // A filled buffer, without waiting. kBroken: the stream has to be started anew; fault() says why.
  Dequeued Dequeue(Buffer& buffer);
  // Gives a buffer back to the driver. False: broken.
  bool Return(const Buffer& buffer);
  const Status& fault() const { return fault_; }

 private:
  struct Mapping {
    void* memory = nullptr;
    std::size_t length = 0;
  };

  explicit V4l2Stream(V4l2Node node) : node_(std::move(node)) {}
  Status Configure(const CameraSettings& settings, std::vector<std::string>& remarks);
  Status SetFormat(const CameraSettings& settings, std::vector<std::string>& remarks);
  void SetRate(const CameraSettings& settings, std::vector<std::string>& remarks);
  void SetControls(const CameraSettings& settings, std::vector<std::string>& remarks);
  Status MapBuffers();
  Status MapBuffer(std::uint32_t index);
  Status Queue(std::uint32_t index);

  V4l2Node node_;
  StreamFormat format_;
  std::vector<Mapping> buffers_;
  bool streaming_ = false;
  Status fault_;
};

}  // namespace viewfix
