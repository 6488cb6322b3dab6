// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/v4l2/v4l2_stream.h"

#include <fcntl.h>
#include <linux/dma-buf.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <memory>
#include <utility>

#include "platform/camera/v4l2/to_yuv.h"

namespace viewfix {
namespace {

// One being read, one waiting, two for the driver to fill.
constexpr std::uint32_t kBuffers = 4;
constexpr std::uint32_t kMaxBuffers = 32;

// Those with chroma that we read first (a model may want it), of each kind what costs us least;
// compressed after them, Bayer last.
constexpr std::uint32_t kPreferred[] = {
    V4L2_PIX_FMT_NV12,   V4L2_PIX_FMT_NV21,    V4L2_PIX_FMT_NV16,    V4L2_PIX_FMT_YUV420,
    V4L2_PIX_FMT_YVU420, V4L2_PIX_FMT_YUV422P, V4L2_PIX_FMT_YUYV,    V4L2_PIX_FMT_UYVY,
    V4L2_PIX_FMT_YVYU,   V4L2_PIX_FMT_VYUY,    V4L2_PIX_FMT_GREY,    V4L2_PIX_FMT_NV12M,
    V4L2_PIX_FMT_NV21M,  V4L2_PIX_FMT_YUV420M, V4L2_PIX_FMT_YVU420M, V4L2_PIX_FMT_Y16,
    V4L2_PIX_FMT_Y12,    V4L2_PIX_FMT_Y10,     V4L2_PIX_FMT_BGR24,   V4L2_PIX_FMT_RGB24,
    V4L2_PIX_FMT_MJPEG,  V4L2_PIX_FMT_JPEG,    V4L2_PIX_FMT_SBGGR8,  V4L2_PIX_FMT_SGBRG8,
    V4L2_PIX_FMT_SGRBG8, V4L2_PIX_FMT_SRGGB8};

// The two structures that a format and a buffer come in, read and written as one.
struct FormatFields {
  std::uint32_t fourcc, width, height, row_bytes, field, quantization, colorspace, ycbcr;
};

FormatFields Read(const v4l2_format& format, bool multi_planar) {
  if (multi_planar) {
    const v4l2_pix_format_mplane& pix = format.fmt.pix_mp;
    return {pix.pixelformat, pix.width,        pix.height,     pix.plane_fmt[0].bytesperline,
            pix.field,       pix.quantization, pix.colorspace, pix.ycbcr_enc};
  }
  const v4l2_pix_format& pix = format.fmt.pix;
  return {pix.pixelformat, pix.width,        pix.height,     pix.bytesperline,
          pix.field,       pix.quantization, pix.colorspace, pix.ycbcr_enc};
}

v4l2_format Wanted(const V4l2Node& node, std::uint32_t fourcc, int width, int height) {
  v4l2_format format = {};
  format.type = node.buffer_type();
  if (node.multi_planar()) {
    format.fmt.pix_mp.pixelformat = fourcc;
    format.fmt.pix_mp.width = static_cast<std::uint32_t>(width);
    format.fmt.pix_mp.height = static_cast<std::uint32_t>(height);
    format.fmt.pix_mp.field = V4L2_FIELD_NONE;
  } else {
    format.fmt.pix.pixelformat = fourcc;
    format.fmt.pix.width = static_cast<std::uint32_t>(width);
    format.fmt.pix.height = static_cast<std::uint32_t>(height);
    format.fmt.pix.field = V4L2_FIELD_NONE;
  }
  return format;
}

// Whether luma is 16..235: what the driver says, else what its colour space means.
bool IsLimitedRange(const FormatFields& fields) {
  if (fields.fourcc == V4L2_PIX_FMT_GREY) return false;
  if (fields.quantization != V4L2_QUANTIZATION_DEFAULT) {
    return fields.quantization == V4L2_QUANTIZATION_LIM_RANGE;
  }
  return fields.colorspace != V4L2_COLORSPACE_JPEG;
}

// How far a size is from what is asked for: too small counts more than too large.
std::int64_t Distance(int width, int height, const CameraSettings& settings) {
  const auto off = [](std::int64_t got, std::int64_t wanted) {
    return got >= wanted ? got - wanted : 4 * (wanted - got);
  };
  return off(width, settings.width) + off(height, settings.height);
}

// Not told counts as reached.
bool ReachesRate(const V4l2Node& node, std::uint32_t fourcc, int width, int height, double rate) {
  if (rate <= 0) return true;
  const std::vector<double> rates = node.Rates(fourcc, width, height);
  return rates.empty() || rates.front() >= 0.95 * rate;
}

// The format to ask for, 0: none that we read. The nearest size first, then a rate that is
// reached, then what costs least.
std::uint32_t ChooseFormat(const V4l2Node& node, const CameraSettings& settings) {
  const std::vector<std::uint32_t> formats = node.PixelFormats();
  std::uint32_t best = 0;
  std::pair<std::int64_t, bool> best_cost;
  for (const std::uint32_t fourcc : kPreferred) {
    if (std::find(formats.begin(), formats.end(), fourcc) == formats.end()) continue;
    if (FourccText(fourcc) == settings.pixel_format) return fourcc;
    v4l2_format format = Wanted(node, fourcc, settings.width, settings.height);
    if (node.Ioctl(VIDIOC_TRY_FMT, &format) != 0) continue;
    const FormatFields got = Read(format, node.multi_planar());
    if (got.fourcc != fourcc) continue;
    const auto width = static_cast<int>(got.width), height = static_cast<int>(got.height);
    const std::pair cost = {Distance(width, height, settings),
                            !ReachesRate(node, fourcc, width, height, settings.rate)};
    if (best != 0 && cost >= best_cost) continue;
    best = fourcc;
    best_cost = cost;
  }
  return best;
}

}  // namespace

Result<std::unique_ptr<V4l2Stream>> V4l2Stream::Start(V4l2Node node, const CameraSettings& settings,
                                                      std::vector<std::string>& remarks) {
  std::unique_ptr<V4l2Stream> stream(new V4l2Stream(std::move(node)));
  if (Status status = stream->Configure(settings, remarks); !status.ok()) return status;
  if (Status status = stream->MapBuffers(); !status.ok()) return status;
  int type = static_cast<int>(stream->node_.buffer_type());
  if (stream->node_.Ioctl(VIDIOC_STREAMON, &type) != 0) return stream->node_.Failed("STREAMON");
  stream->streaming_ = true;
  return stream;
}

V4l2Stream::~V4l2Stream() {
  int type = static_cast<int>(node_.buffer_type());
  if (streaming_) node_.Ioctl(VIDIOC_STREAMOFF, &type);
  for (const Mapping& buffer : buffers_) {
    if (buffer.memory != nullptr) node_.system().Unmap(buffer.memory, buffer.length);
    if (buffer.dmabuf >= 0) node_.system().Close(buffer.dmabuf);
  }
}

Status V4l2Stream::Configure(const CameraSettings& settings, std::vector<std::string>& remarks) {
  if (Status status = SetFormat(settings, remarks); !status.ok()) return status;
  SetRate(settings, remarks);
  SetControls(settings, remarks);
  return {};
}

Status V4l2Stream::SetFormat(const CameraSettings& settings, std::vector<std::string>& remarks) {
  const std::uint32_t fourcc = ChooseFormat(node_, settings);
  if (fourcc == 0) return {StatusCode::kUnsupported, "no pixel format that we read", node_.path()};
  v4l2_format format = Wanted(node_, fourcc, settings.width, settings.height);
  if (node_.Ioctl(VIDIOC_S_FMT, &format) != 0) return node_.Failed("S_FMT");
  const FormatFields got = Read(format, node_.multi_planar());
  if (!KnowsPixelFormat(got.fourcc) || got.width == 0 || got.height == 0 ||
      got.width > unsigned{kMaxImageSide} || got.height > unsigned{kMaxImageSide}) {
    return {StatusCode::kUnsupported, "no pixel format that we read", node_.path()};
  }
  format_ = {got.fourcc,    static_cast<int>(got.width), static_cast<int>(got.height),
             got.row_bytes, IsLimitedRange(got),         0};
  RemarkFormat(settings, FourccText(got.fourcc), format_.width, format_.height, remarks);
  return {};
}

void V4l2Stream::SetRate(const CameraSettings& settings, std::vector<std::string>& remarks) {
  v4l2_streamparm parameters = {};
  parameters.type = node_.buffer_type();
  if (node_.Ioctl(VIDIOC_G_PARM, &parameters) != 0) return;
  v4l2_captureparm& capture = parameters.parm.capture;
  if (settings.rate > 0 && (capture.capability & V4L2_CAP_TIMEPERFRAME) != 0) {
    capture.timeperframe = {1000, static_cast<std::uint32_t>(settings.rate * 1000)};
    if (node_.Ioctl(VIDIOC_S_PARM, &parameters) != 0) remarks.push_back("the rate stays as it is");
  }
  const v4l2_fract interval = capture.timeperframe;
  if (interval.numerator == 0) return;
  format_.rate = double(interval.denominator) / interval.numerator;
  if (settings.rate <= 0 || std::abs(format_.rate - settings.rate) < 0.05 * settings.rate) return;
  char remark[64];
  std::snprintf(remark, sizeof remark, "no rate of %g/s, taking %g/s", settings.rate, format_.rate);
  remarks.push_back(remark);
}

// Those that switch an automatism first: while it is on, others cannot be set.
void V4l2Stream::SetControls(const CameraSettings& settings, std::vector<std::string>& remarks) {
  if (settings.controls.empty()) return;
  std::vector<CameraControl> wanted = settings.controls;
  std::stable_partition(wanted.begin(), wanted.end(), [](const CameraControl& control) {
    return control.name.find("auto") != std::string::npos;
  });
  const std::vector<V4l2ControlInfo> known = node_.Controls();
  for (const CameraControl& control : wanted) {
    const auto info = std::find_if(known.begin(), known.end(), [&](const V4l2ControlInfo& k) {
      return k.name == control.name;
    });
    const std::string fault =
        info == known.end() ? "the camera has none" : node_.SetControl(*info, control.value);
    if (fault.empty()) continue;
    remarks.push_back("control " + control.name + "=" + std::to_string(control.value) + ": " +
                      fault);
  }
}

Status V4l2Stream::MapBuffers() {
  v4l2_requestbuffers request = {};
  request.count = kBuffers;
  request.type = node_.buffer_type();
  request.memory = V4L2_MEMORY_MMAP;
  if (node_.Ioctl(VIDIOC_REQBUFS, &request) != 0) return node_.Failed("REQBUFS");
  if (request.count == 0 || request.count > kMaxBuffers) {
    return {StatusCode::kIo, "camera gives no buffers", node_.path()};
  }
  for (std::uint32_t index = 0; index < request.count; ++index) {
    if (Status status = MapBuffer(index); !status.ok()) return status;
    if (Status status = Queue(index); !status.ok()) return status;
  }
  return {};
}

Status V4l2Stream::MapBuffer(std::uint32_t index) {
  std::array<v4l2_plane, VIDEO_MAX_PLANES> planes = {};
  v4l2_buffer buffer = {};
  buffer.index = index;
  buffer.type = node_.buffer_type();
  buffer.memory = V4L2_MEMORY_MMAP;
  const bool multi = node_.multi_planar();
  if (multi) {
    buffer.m.planes = planes.data();
    buffer.length = VIDEO_MAX_PLANES;
  }
  if (node_.Ioctl(VIDIOC_QUERYBUF, &buffer) != 0) return node_.Failed("QUERYBUF");
  // Luma stands in the first plane of every format that we read.
  const std::size_t length = multi ? planes[0].length : buffer.length;
  const std::size_t offset = multi ? planes[0].m.mem_offset : buffer.m.offset;
  Mapping mapping = MapExported(index, length);
  if (mapping.memory == nullptr) {
    mapping = {node_.system().Map(node_.fd(), length, offset), length, -1};
  }
  if (mapping.memory == nullptr) return node_.Failed("mmap");
  buffers_.push_back(mapping);
  return {};
}

// Without memory: the driver exports no buffers.
V4l2Stream::Mapping V4l2Stream::MapExported(std::uint32_t index, std::size_t length) {
  v4l2_exportbuffer exported = {};
  exported.type = node_.buffer_type();
  exported.index = index;
  exported.flags = O_RDWR | O_CLOEXEC;
  if (node_.Ioctl(VIDIOC_EXPBUF, &exported) != 0) return {};
  void* memory = node_.system().Map(exported.fd, length, 0);
  if (memory != nullptr) return {memory, length, exported.fd};
  node_.system().Close(exported.fd);
  return {};
}

void V4l2Stream::Synchronize(const Mapping& mapping, std::uint64_t flags) const {
  if (mapping.dmabuf < 0) return;
  dma_buf_sync sync = {flags};
  node_.system().Ioctl(mapping.dmabuf, DMA_BUF_IOCTL_SYNC, &sync);
}

Status V4l2Stream::Queue(std::uint32_t index) {
  std::array<v4l2_plane, VIDEO_MAX_PLANES> planes = {};
  v4l2_buffer buffer = {};
  buffer.index = index;
  buffer.type = node_.buffer_type();
  buffer.memory = V4L2_MEMORY_MMAP;
  if (node_.multi_planar()) {
    buffer.m.planes = planes.data();
    buffer.length = VIDEO_MAX_PLANES;
  }
  return node_.Ioctl(VIDIOC_QBUF, &buffer) == 0 ? Status() : node_.Failed("QBUF");
}

std::string V4l2Stream::text() const {
  char text[96];
  std::snprintf(text, sizeof text, "%dx%d %s at %g/s, ", format_.width, format_.height,
                FourccText(format_.fourcc).c_str(), format_.rate);
  const bool exported = !buffers_.empty() && buffers_[0].dmabuf >= 0;
  return text + node_.identity().card + " at " + node_.path() + (exported ? ", DMABUF" : "");
}

int V4l2Stream::Wait(int wake_fd, int timeout_ms) {
  const int events = node_.system().Poll(node_.fd(), wake_fd, timeout_ms);
  if (events < 0) fault_ = node_.Failed("poll");
  return events;
}

V4l2Stream::Dequeued V4l2Stream::Dequeue(Buffer& buffer) {
  std::array<v4l2_plane, VIDEO_MAX_PLANES> planes = {};
  v4l2_buffer raw = {};
  raw.type = node_.buffer_type();
  raw.memory = V4L2_MEMORY_MMAP;
  const bool multi = node_.multi_planar();
  if (multi) {
    raw.m.planes = planes.data();
    raw.length = VIDEO_MAX_PLANES;
  }
  if (node_.Ioctl(VIDIOC_DQBUF, &raw) != 0) {
    if (errno == EAGAIN) return Dequeued::kNone;
    fault_ = node_.Failed("DQBUF");
    return Dequeued::kBroken;
  }
  if (raw.index >= buffers_.size()) {
    fault_ = {StatusCode::kIo, "camera gives a buffer that it does not have", node_.path()};
    return Dequeued::kBroken;
  }
  const Mapping& mapping = buffers_[raw.index];
  Synchronize(mapping, DMA_BUF_SYNC_START | DMA_BUF_SYNC_READ);
  const std::size_t used = multi ? planes[0].bytesused : raw.bytesused;
  const std::size_t offset = multi ? std::min<std::size_t>(planes[0].data_offset, used) : 0;
  const std::size_t end = std::min(used, mapping.length);
  const auto* memory = static_cast<const std::uint8_t*>(mapping.memory);
  buffer.image = {
      format_.fourcc,        format_.width,
      format_.height,        format_.row_bytes,
      format_.limited_range, {memory + std::min(offset, end), end - std::min(offset, end)}};
  buffer.index = raw.index;
  buffer.sequence = raw.sequence;
  buffer.erroneous = (raw.flags & V4L2_BUF_FLAG_ERROR) != 0;
  const bool monotonic =
      (raw.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  buffer.time_ns = monotonic ? std::int64_t{raw.timestamp.tv_sec} * 1'000'000'000 +
                                   std::int64_t{raw.timestamp.tv_usec} * 1000
                             : 0;
  return Dequeued::kBuffer;
}

bool V4l2Stream::Return(const Buffer& buffer) {
  Synchronize(buffers_[buffer.index], DMA_BUF_SYNC_END | DMA_BUF_SYNC_READ);
  fault_ = Queue(buffer.index);
  return fault_.ok();
}

}  // namespace viewfix
