// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "platform/camera/camera_settings.h"
#include "platform/camera/live_camera.h"
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

// A node that streams into buffers of its own memory: format, rate, controls, buffers. Where the
// driver exports them as DMABUFs they are mapped as such, and read between the calls that make the
// processor's caches agree with what the device wrote. Stops and gives its memory back at the end.
class V4l2Stream : public CameraStream {
 public:
  // `remarks`: what was asked for and not to be had, one line each.
  static Result<std::unique_ptr<V4l2Stream>> Start(V4l2Node node, const CameraSettings& settings,
                                                   std::vector<std::string>& remarks);
  ~V4l2Stream() override;
  V4l2Stream(const V4l2Stream&) = delete;
  V4l2Stream& operator=(const V4l2Stream&) = delete;

  std::string text() const override;
  int Wait(int wake_fd, int timeout_ms) override;
  Dequeued Dequeue(Buffer& buffer) override;
  bool Return(const Buffer& buffer) override;
  const Status& fault() const override { return fault_; }

 private:
  struct Mapping {
    void* memory = nullptr;
    std::size_t length = 0;
    int dmabuf = -1;  // that it is mapped from; -1: from the node
  };

  explicit V4l2Stream(V4l2Node node) : node_(std::move(node)) {}
  Status Configure(const CameraSettings& settings, std::vector<std::string>& remarks);
  Status SetFormat(const CameraSettings& settings, std::vector<std::string>& remarks);
  void SetRate(const CameraSettings& settings, std::vector<std::string>& remarks);
  void SetControls(const CameraSettings& settings, std::vector<std::string>& remarks);
  Status MapBuffers();
  Status MapBuffer(std::uint32_t index);
  Mapping MapExported(std::uint32_t index, std::size_t length);
  void Synchronize(const Mapping& mapping, std::uint64_t flags) const;
  Status Queue(std::uint32_t index);

  V4l2Node node_;
  StreamFormat format_;
  std::vector<Mapping> buffers_;
  bool streaming_ = false;
  Status fault_;
};

}  // namespace viewfix
