// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <linux/dma-buf.h>
#include <linux/videodev2.h>
#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <deque>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "platform/camera/v4l2/v4l2_system.h"

namespace viewfix {

// One camera without a driver.
struct FakeCamera {
  struct Filled {
    std::uint32_t index = 0;
    std::size_t bytes = 0;
    std::uint32_t flags = 0;
    std::uint32_t sequence = 0;
    std::int64_t time_ns = 0;
  };

  std::string path = "/dev/video0";
  std::string card = "Fake Camera";
  std::string bus = "usb-1";
  bool plugged = true;
  bool multi_planar = false;
  bool exports = false;  // its buffers, as DMABUFs
  int being_read = 0;    // of those, between the calls that say so
  std::vector<std::uint32_t> formats = {V4L2_PIX_FMT_YUYV};
  std::uint32_t width = 64, height = 48;  // the only size
  std::size_t row_bytes = 0;              // 0: without padding
  std::uint32_t quantization = V4L2_QUANTIZATION_FULL_RANGE;
  v4l2_fract interval = {1, 30};
  std::map<std::string, std::int32_t> controls = {{"Gain", 0}, {"Exposure, Auto", 3}};
  std::vector<std::string> set_order;  // of controls

  // What it is doing.
  std::uint32_t fourcc = 0;
  bool streaming = false;
  std::vector<std::vector<std::uint8_t>> memory;
  std::deque<std::uint32_t> queued;
  std::deque<Filled> filled;
  std::map<unsigned long, std::deque<int>> errors;  // of the next calls, by request; 0: none
  bool error_on_poll = false;

  // Fills the next buffer with this many bytes, or else all, of `value`. False: none is queued.
  bool Fill(std::uint32_t sequence, std::uint8_t value, std::uint32_t flags = 0,
            std::size_t bytes = SIZE_MAX) {
    if (queued.empty()) return false;
    std::vector<std::uint8_t>& buffer = memory[queued.front()];
    std::fill(buffer.begin(), buffer.end(), value);
    filled.push_back({queued.front(), std::min(bytes, buffer.size()),
                      flags | V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC, sequence,
                      1'000'000'000 + std::int64_t{sequence} * 33'000'000});
    queued.pop_front();
    return true;
  }
};

// Drives FakeCameras as the kernel drives real ones, as far as V4l2Camera can tell.
class FakeV4l2 : public V4l2System {
 public:
  std::vector<FakeCamera> cameras = std::vector<FakeCamera>(1);
  std::map<std::string, std::string> links;  // from path to path
  int polls = 0;
  int mapped = 0;

  std::size_t open_files() const { return files_.size() + exported_.size(); }

  int Open(const char* path) override {
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      if (!cameras[i].plugged || cameras[i].path != path) continue;
      files_[++last_file_] = i;
      return last_file_;
    }
    errno = ENOENT;
    return -1;
  }
  int Close(int fd) override {
    if (exported_.erase(fd) != 0) return 0;
    const auto file = files_.find(fd);
    if (file == files_.end()) return -1;
    Stop(cameras[file->second]);
    files_.erase(file);
    return 0;
  }

  int Poll(int fd, int wake_fd, int) override {
    ++polls;
    const FakeCamera& camera = cameras[files_.at(fd)];
    if (!camera.plugged) return POLLERR | POLLHUP;
    if (camera.error_on_poll) return POLLERR;
    if (!camera.filled.empty()) return POLLIN;
    pollfd waiting = {wake_fd, POLLIN, 0};
    (void)::poll(&waiting, 1, 0);
    return 0;
  }

  void* Map(int fd, std::size_t length, std::size_t offset) override {
    const auto exported = exported_.find(fd);
    const bool is_exported = exported != exported_.end();
    FakeCamera& camera = cameras[is_exported ? exported->second.first : files_.at(fd)];
    std::vector<std::uint8_t>& buffer =
        camera.memory.at(is_exported ? exported->second.second : offset >> 20);
    if (buffer.size() != length) return nullptr;
    ++mapped;
    return buffer.data();
  }
  void Unmap(void*, std::size_t) override { --mapped; }

  std::vector<std::string> Nodes() override {
    std::set<std::string> nodes;
    for (const FakeCamera& camera : cameras) {
      if (camera.plugged) nodes.insert(camera.path);
    }
    return {nodes.begin(), nodes.end()};
  }
  std::string Resolve(const std::string& path) override {
    const auto link = links.find(path);
    if (link != links.end()) return link->second;
    const std::vector<std::string> nodes = Nodes();
    return std::find(nodes.begin(), nodes.end(), path) == nodes.end() ? "" : path;
  }
  std::vector<std::string> StableNames(const std::string& node) override {
    std::vector<std::string> names;
    for (const auto& [from, to] : links) {
      if (to == node) names.push_back(from);
    }
    return names;
  }

  int Ioctl(int fd, unsigned long request, void* argument) override {
    if (request == DMA_BUF_IOCTL_SYNC) {
      const bool ends = (static_cast<dma_buf_sync*>(argument)->flags & DMA_BUF_SYNC_END) != 0;
      cameras[exported_.at(fd).first].being_read += ends ? -1 : 1;
      return 0;
    }
    FakeCamera& camera = cameras[files_.at(fd)];
    if (!camera.plugged) return Refuse(ENODEV);
    std::deque<int>& errors = camera.errors[request];
    if (!errors.empty()) {
      const int error = errors.front();
      errors.pop_front();
      if (error != 0) return Refuse(error);
    }
    if (request == VIDIOC_EXPBUF) {
      if (!camera.exports) return Refuse(ENOTTY);
      auto& exported = *static_cast<v4l2_exportbuffer*>(argument);
      exported.fd = ++last_file_;
      exported_[exported.fd] = {files_.at(fd), exported.index};
      return 0;
    }
    return Serve(camera, request, argument);
  }

 private:
  static int Refuse(int error) {
    errno = error;
    return -1;
  }

  static void Stop(FakeCamera& camera) {
    camera.streaming = false;
    camera.queued.clear();
    camera.filled.clear();
  }

  static int Serve(FakeCamera& camera, unsigned long request, void* argument) {
    switch (request) {
      case VIDIOC_QUERYCAP:
        return QueryCapabilities(camera, *static_cast<v4l2_capability*>(argument));
      case VIDIOC_ENUM_FMT:
        return EnumFormat(camera, *static_cast<v4l2_fmtdesc*>(argument));
      case VIDIOC_ENUM_FRAMESIZES:
        return EnumSize(camera, *static_cast<v4l2_frmsizeenum*>(argument));
      case VIDIOC_ENUM_FRAMEINTERVALS:
        return EnumInterval(camera, *static_cast<v4l2_frmivalenum*>(argument));
      case VIDIOC_TRY_FMT:
      case VIDIOC_S_FMT:
        return SetFormat(camera, *static_cast<v4l2_format*>(argument));
      case VIDIOC_G_PARM:
      case VIDIOC_S_PARM:
        return Parameters(camera, request, *static_cast<v4l2_streamparm*>(argument));
      case VIDIOC_QUERY_EXT_CTRL:
        return QueryControl(camera, *static_cast<v4l2_query_ext_ctrl*>(argument));
      case VIDIOC_S_EXT_CTRLS:
        return SetControl(camera, *static_cast<v4l2_ext_controls*>(argument));
      case VIDIOC_REQBUFS:
        return RequestBuffers(camera, *static_cast<v4l2_requestbuffers*>(argument));
      case VIDIOC_QUERYBUF:
        return QueryBuffer(camera, *static_cast<v4l2_buffer*>(argument));
      case VIDIOC_QBUF:
        camera.queued.push_back(static_cast<v4l2_buffer*>(argument)->index);
        return 0;
      case VIDIOC_DQBUF:
        return Dequeue(camera, *static_cast<v4l2_buffer*>(argument));
      case VIDIOC_STREAMON:
        camera.streaming = true;
        return 0;
      case VIDIOC_STREAMOFF:
        Stop(camera);
        return 0;
      default:
        return Refuse(ENOTTY);
    }
  }

  template <std::size_t N>
  static void Copy(const std::string& text, std::uint8_t (&field)[N]) {
    std::memcpy(field, text.c_str(), std::min(N, text.size() + 1));
  }

  static int QueryCapabilities(const FakeCamera& camera, v4l2_capability& capability) {
    Copy("fake", capability.driver);
    Copy(camera.card, capability.card);
    Copy(camera.bus, capability.bus_info);
    capability.device_caps =
        V4L2_CAP_STREAMING |
        (camera.multi_planar ? V4L2_CAP_VIDEO_CAPTURE_MPLANE : V4L2_CAP_VIDEO_CAPTURE);
    capability.capabilities = capability.device_caps | V4L2_CAP_DEVICE_CAPS;
    return 0;
  }

  static int EnumFormat(const FakeCamera& camera, v4l2_fmtdesc& format) {
    if (format.index >= camera.formats.size()) return Refuse(EINVAL);
    format.pixelformat = camera.formats[format.index];
    return 0;
  }

  static int EnumSize(const FakeCamera& camera, v4l2_frmsizeenum& size) {
    if (size.index > 0) return Refuse(EINVAL);
    size.type = V4L2_FRMSIZE_TYPE_DISCRETE;
    size.discrete = {camera.width, camera.height};
    return 0;
  }

  static int EnumInterval(const FakeCamera& camera, v4l2_frmivalenum& interval) {
    if (interval.index > 0) return Refuse(EINVAL);
    interval.type = V4L2_FRMIVAL_TYPE_DISCRETE;
    interval.discrete = camera.interval;
    return 0;
  }

  static std::size_t RowBytesOf(const FakeCamera& camera, std::uint32_t fourcc) {
    if (camera.row_bytes != 0) return camera.row_bytes;
    switch (fourcc) {
      case V4L2_PIX_FMT_YUYV:
      case V4L2_PIX_FMT_UYVY:
        return 2 * std::size_t{camera.width};
      case V4L2_PIX_FMT_RGB24:
      case V4L2_PIX_FMT_BGR24:
        return 3 * std::size_t{camera.width};
      default:
        return camera.width;
    }
  }

  static int SetFormat(FakeCamera& camera, v4l2_format& format) {
    const std::uint32_t wanted =
        camera.multi_planar ? format.fmt.pix_mp.pixelformat : format.fmt.pix.pixelformat;
    const bool known =
        std::find(camera.formats.begin(), camera.formats.end(), wanted) != camera.formats.end();
    camera.fourcc = known ? wanted : camera.formats.front();
    const auto row_bytes = static_cast<std::uint32_t>(RowBytesOf(camera, camera.fourcc));
    if (camera.multi_planar) {
      v4l2_pix_format_mplane& pix = format.fmt.pix_mp;
      pix.pixelformat = camera.fourcc;
      pix.width = camera.width;
      pix.height = camera.height;
      pix.num_planes = 1;
      pix.plane_fmt[0].bytesperline = row_bytes;
      pix.quantization = static_cast<std::uint8_t>(camera.quantization);
    } else {
      v4l2_pix_format& pix = format.fmt.pix;
      pix.pixelformat = camera.fourcc;
      pix.width = camera.width;
      pix.height = camera.height;
      pix.bytesperline = row_bytes;
      pix.quantization = camera.quantization;
    }
    return 0;
  }

  static int Parameters(FakeCamera& camera, unsigned long request, v4l2_streamparm& parameters) {
    v4l2_captureparm& capture = parameters.parm.capture;
    if (request == VIDIOC_S_PARM) camera.interval = capture.timeperframe;
    capture.capability = V4L2_CAP_TIMEPERFRAME;
    capture.timeperframe = camera.interval;
    return 0;
  }

  static int QueryControl(const FakeCamera& camera, v4l2_query_ext_ctrl& query) {
    const std::uint32_t after = query.id & ~V4L2_CTRL_FLAG_NEXT_CTRL;
    std::uint32_t id = 0;
    for (const auto& [name, value] : camera.controls) {
      if (++id <= after) continue;
      query = {};
      query.id = id;
      query.type = V4L2_CTRL_TYPE_INTEGER;
      std::memcpy(query.name, name.c_str(), name.size() + 1);
      query.maximum = 1000;
      query.step = 1;
      return 0;
    }
    return Refuse(EINVAL);
  }

  static int SetControl(FakeCamera& camera, v4l2_ext_controls& controls) {
    std::uint32_t id = 0;
    for (auto& [name, value] : camera.controls) {
      if (++id != controls.controls[0].id) continue;
      value = controls.controls[0].value;
      camera.set_order.push_back(name);
      return 0;
    }
    return Refuse(EINVAL);
  }

  static int RequestBuffers(FakeCamera& camera, v4l2_requestbuffers& request) {
    const std::size_t size = RowBytesOf(camera, camera.fourcc) * camera.height;
    camera.memory.assign(request.count, std::vector<std::uint8_t>(size));
    camera.queued.clear();
    camera.filled.clear();
    return 0;
  }

  static int QueryBuffer(const FakeCamera& camera, v4l2_buffer& buffer) {
    const auto length = static_cast<std::uint32_t>(camera.memory.at(buffer.index).size());
    if (camera.multi_planar) {
      buffer.m.planes[0].length = length;
      buffer.m.planes[0].m.mem_offset = buffer.index << 20;
    } else {
      buffer.length = length;
      buffer.m.offset = buffer.index << 20;
    }
    return 0;
  }

  static int Dequeue(FakeCamera& camera, v4l2_buffer& buffer) {
    if (camera.filled.empty()) return Refuse(EAGAIN);
    const FakeCamera::Filled filled = camera.filled.front();
    camera.filled.pop_front();
    buffer.index = filled.index;
    buffer.sequence = filled.sequence;
    buffer.flags = filled.flags;
    buffer.timestamp.tv_sec = filled.time_ns / 1'000'000'000;
    buffer.timestamp.tv_usec = filled.time_ns % 1'000'000'000 / 1000;
    const auto bytes = static_cast<std::uint32_t>(filled.bytes);
    if (camera.multi_planar) {
      buffer.m.planes[0].bytesused = bytes;
    } else {
      buffer.bytesused = bytes;
    }
    return 0;
  }

  std::map<int, std::size_t> files_;                             // descriptor to camera
  std::map<int, std::pair<std::size_t, std::size_t>> exported_;  // to camera and buffer
  int last_file_ = 100;
};

}  // namespace viewfix
