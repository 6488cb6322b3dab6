// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/base/status.h"
#include "platform/camera/v4l2/v4l2_system.h"

namespace viewfix {

// What tells one camera from another, whatever the number of its node.
struct CameraIdentity {
  std::string driver;
  std::string card;  // "HD Pro Webcam C920"
  std::string bus;   // "usb-0000:00:14.0-1"

  friend bool operator==(const CameraIdentity&, const CameraIdentity&) = default;
};

struct V4l2ControlInfo {
  std::uint32_t id = 0;
  std::string name;  // "exposure_time_absolute"
  std::int64_t minimum = 0, maximum = 0, step = 0, standard = 0;
  bool read_only = false;
  bool inactive = false;          // another control has it
  std::vector<std::string> menu;  // what the values of a menu mean: "1 Manual Mode"
};

struct V4l2SizeInfo {
  int width = 0, height = 0;
  std::vector<double> rates;  // frames a second, highest first; empty: not told
};

struct V4l2FormatInfo {
  std::uint32_t fourcc = 0;
  std::string text;                 // the driver's description
  std::vector<V4l2SizeInfo> sizes;  // of ranges, the largest
};

// "YUYV" for the number, and back; 0: not four characters.
std::string FourccText(std::uint32_t fourcc);
std::uint32_t FourccOf(const std::string& text);

// An open video node that captures. Closes itself.
class V4l2Node {
 public:
  // kNotFound: it is not there; kUnsupported: it does not capture; kIo: busy, forbidden.
  static Result<V4l2Node> Open(V4l2System& system, const std::string& path);
  V4l2Node(V4l2Node&& other) noexcept;
  V4l2Node& operator=(V4l2Node&&) = delete;
  ~V4l2Node();

  V4l2System& system() const { return *system_; }
  int fd() const { return fd_; }
  const std::string& path() const { return path_; }
  const CameraIdentity& identity() const { return identity_; }
  std::uint32_t buffer_type() const { return buffer_type_; }
  bool multi_planar() const { return multi_planar_; }

  // All of it takes thousands of requests; what a stream is chosen by, a few.
  std::vector<V4l2FormatInfo> Formats() const;
  std::vector<std::uint32_t> PixelFormats() const;
  // Frames a second, highest first; empty: not told.
  std::vector<double> Rates(std::uint32_t fourcc, int width, int height) const;
  std::vector<V4l2ControlInfo> Controls() const;
  // Empty: set; else why not.
  std::string SetControl(const V4l2ControlInfo& control, std::int64_t value) const;

  // "request: reason" of errno.
  Status Failed(const char* request) const;
  int Ioctl(unsigned long request, void* argument) const {
    return system_->Ioctl(fd_, request, argument);
  }

 private:
  V4l2Node(V4l2System& system, std::string path, int fd);
  Status ReadCapabilities();
  std::vector<V4l2SizeInfo> Sizes(std::uint32_t fourcc) const;

  V4l2System* system_;
  std::string path_;
  int fd_;
  CameraIdentity identity_;
  std::uint32_t buffer_type_ = 0;
  bool multi_planar_ = false;
};

// The node of a camera that `where` names: a path (links are followed), a name in /dev/v4l/by-id,
// or a part of the card's name. `known`, if this camera was open before: a path that leads nowhere,
// or to another camera by now, is looked for under the other nodes. kNotFound otherwise.
Result<V4l2Node> FindCamera(V4l2System& system, const std::string& where,
                            const std::optional<CameraIdentity>& known);

}  // namespace viewfix
