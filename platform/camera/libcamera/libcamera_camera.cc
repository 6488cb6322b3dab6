// SPDX-License-Identifier: BSD-3-Clause
//
// The one file that knows libcamera, by what its 0.0.3 (Debian 12) and current releases have in
// common.
#include "platform/camera/libcamera/libcamera_camera.h"

#include <libcamera/camera.h>
#include <libcamera/camera_manager.h>
#include <libcamera/control_ids.h>
#include <libcamera/framebuffer_allocator.h>
#include <libcamera/logging.h>
#include <libcamera/property_ids.h>
#include <libcamera/request.h>
#include <linux/videodev2.h>
#include <sys/mman.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <utility>
#include <vector>

#include "platform/camera/libcamera/completed_queue.h"
#include "platform/camera/libcamera/pixel_formats.h"
#include "platform/camera/live_camera.h"
#include "platform/camera/v4l2/v4l2_node.h"
#include "platform/clock.h"

namespace viewfix {
namespace {

namespace lc = libcamera;

constexpr unsigned int kBuffers = 4;  // as V4l2Stream's

// As V4l2Stream's.
constexpr std::uint32_t kPreferred[] = {V4L2_PIX_FMT_NV12,  V4L2_PIX_FMT_NV21,  V4L2_PIX_FMT_YUV420,
                                        V4L2_PIX_FMT_YUYV,  V4L2_PIX_FMT_UYVY,  V4L2_PIX_FMT_GREY,
                                        V4L2_PIX_FMT_BGR24, V4L2_PIX_FMT_RGB24, V4L2_PIX_FMT_MJPEG};

// libcamera ends a process that has two managers. Used by the thread that captures alone.
std::shared_ptr<lc::CameraManager> SharedManager() {
  static std::weak_ptr<lc::CameraManager> shared;
  if (std::shared_ptr<lc::CameraManager> manager = shared.lock()) return manager;
  // Its own log speaks of each start; whoever looks for a fault asks for it.
  if (std::getenv("LIBCAMERA_LOG_LEVELS") == nullptr) lc::logSetTarget(lc::LoggingTargetNone);
  std::shared_ptr<lc::CameraManager> manager(new lc::CameraManager, [](lc::CameraManager* ended) {
    ended->stop();
    delete ended;
  });
  if (manager->start() != 0) return nullptr;
  shared = manager;
  return manager;
}

std::string ModelOf(const lc::Camera& camera) {
  const auto model = camera.properties().get(lc::properties::Model);
  return model ? std::string(*model) : std::string();
}

std::shared_ptr<lc::Camera> FindCamera(const lc::CameraManager& manager, const std::string& where) {
  for (const std::shared_ptr<lc::Camera>& camera : manager.cameras()) {
    const bool named = camera->id().find(where) != std::string::npos ||
                       ModelOf(*camera).find(where) != std::string::npos;
    if (named) return camera;
  }
  return nullptr;
}

lc::PixelFormat ChooseFormat(const lc::StreamConfiguration& stream, const std::string& wanted) {
  lc::PixelFormat best;
  auto best_rank = std::end(kPreferred);
  for (const lc::PixelFormat& format : stream.formats().pixelformats()) {
    const std::uint32_t ours = V4l2FormatOf(format.fourcc());
    if (ours != 0 && FourccText(ours) == wanted) return format;
    const auto rank = std::find(std::begin(kPreferred), std::end(kPreferred), ours);
    if (rank >= best_rank) continue;
    best = format;
    best_rank = rank;
  }
  return best;
}

// Of the control's own type; none: it takes no number.
lc::ControlValue ValueOf(lc::ControlType type, std::int64_t value) {
  switch (type) {
    case lc::ControlTypeBool:
      return lc::ControlValue(value != 0);
    case lc::ControlTypeByte:
      return lc::ControlValue(static_cast<std::uint8_t>(value));
    case lc::ControlTypeInteger32:
      return lc::ControlValue(static_cast<std::int32_t>(value));
    case lc::ControlTypeInteger64:
      return lc::ControlValue(value);
    case lc::ControlTypeFloat:
      return lc::ControlValue(static_cast<float>(value));
    default:
      return {};
  }
}

class LibcameraStream : public CameraStream {
 public:
  static Result<std::unique_ptr<CameraStream>> Start(std::shared_ptr<lc::CameraManager> manager,
                                                     std::shared_ptr<lc::Camera> camera,
                                                     const CameraSettings& settings,
                                                     std::vector<std::string>& remarks);
  ~LibcameraStream() override;

  std::string text() const override;
  int Wait(int wake_fd, int timeout_ms) override { return completed_.Wait(wake_fd, timeout_ms); }
  Dequeued Dequeue(Buffer& buffer) override;
  bool Return(const Buffer& buffer) override;
  const Status& fault() const override { return fault_; }

 private:
  struct Slot {
    std::unique_ptr<lc::Request> request;
    lc::FrameBuffer* buffer = nullptr;
    void* memory = nullptr;
    std::size_t length = 0;
  };

  LibcameraStream(std::shared_ptr<lc::CameraManager> manager, std::shared_ptr<lc::Camera> camera)
      : manager_(std::move(manager)), camera_(std::move(camera)) {}
  Status Configure(const CameraSettings& settings, std::vector<std::string>& remarks);
  lc::ControlList Controls(const CameraSettings& settings, std::vector<std::string>& remarks);
  Status MapBuffers();
  Status MapBuffer(lc::FrameBuffer* buffer);
  Status Begin(const lc::ControlList& controls);
  Status Failed(const char* what) const { return {StatusCode::kIo, what, camera_->id()}; }
  // Both are called by libcamera's thread.
  void OnCompleted(lc::Request* request);
  void OnDisconnected() { completed_.Break(); }

  std::shared_ptr<lc::CameraManager> manager_;
  std::shared_ptr<lc::Camera> camera_;
  std::unique_ptr<lc::CameraConfiguration> configuration_;
  std::unique_ptr<lc::FrameBufferAllocator> allocator_;
  std::vector<Slot> slots_;  // a request's cookie is its index
  CompletedQueue completed_;
  RawImage format_;  // without bytes
  double rate_ = 0;  // frames a second asked for; 0: the camera's own
  bool acquired_ = false;
  bool started_ = false;
  Status fault_;
};

Result<std::unique_ptr<CameraStream>> LibcameraStream::Start(
    std::shared_ptr<lc::CameraManager> manager, std::shared_ptr<lc::Camera> camera,
    const CameraSettings& settings, std::vector<std::string>& remarks) {
  std::unique_ptr<LibcameraStream> stream(
      new LibcameraStream(std::move(manager), std::move(camera)));
  if (Status status = stream->Configure(settings, remarks); !status.ok()) return status;
  if (Status status = stream->MapBuffers(); !status.ok()) return status;
  if (Status status = stream->Begin(stream->Controls(settings, remarks)); !status.ok()) {
    return status;
  }
  return std::unique_ptr<CameraStream>(std::move(stream));
}

LibcameraStream::~LibcameraStream() {
  if (started_) camera_->stop();
  camera_->requestCompleted.disconnect(this);
  camera_->disconnected.disconnect(this);
  for (Slot& slot : slots_) {
    slot.request.reset();
    if (slot.memory != nullptr) ::munmap(slot.memory, slot.length);
  }
  allocator_.reset();
  if (acquired_) camera_->release();
}

Status LibcameraStream::Configure(const CameraSettings& settings,
                                  std::vector<std::string>& remarks) {
  if (camera_->acquire() != 0) return Failed("camera is in use");
  acquired_ = true;
  configuration_ = camera_->generateConfiguration({lc::StreamRole::Viewfinder});
  if (configuration_ == nullptr || configuration_->empty()) return Failed("camera has no stream");
  lc::StreamConfiguration& stream = configuration_->at(0);
  stream.pixelFormat = ChooseFormat(stream, settings.pixel_format);
  stream.size =
      lc::Size(static_cast<unsigned>(settings.width), static_cast<unsigned>(settings.height));
  stream.bufferCount = kBuffers;
  if (configuration_->validate() == lc::CameraConfiguration::Invalid ||
      camera_->configure(configuration_.get()) != 0) {
    return Failed("camera refuses the format");
  }
  format_.fourcc = V4l2FormatOf(stream.pixelFormat.fourcc());
  if (format_.fourcc == 0 || stream.size.width > unsigned{kMaxImageSide} ||
      stream.size.height > unsigned{kMaxImageSide}) {
    return Failed("no pixel format that we read");
  }
  format_.width = static_cast<int>(stream.size.width);
  format_.height = static_cast<int>(stream.size.height);
  format_.row_bytes = stream.stride;
  format_.limited_range =
      stream.colorSpace && stream.colorSpace->range == lc::ColorSpace::Range::Limited;
  RemarkFormat(settings, FourccText(format_.fourcc), format_.width, format_.height, remarks);
  return {};
}

lc::ControlList LibcameraStream::Controls(const CameraSettings& settings,
                                          std::vector<std::string>& remarks) {
  const lc::ControlInfoMap& known = camera_->controls();
  lc::ControlList list(known);
  for (const CameraControl& control : settings.controls) {
    const auto found = std::find_if(known.begin(), known.end(), [&](const auto& entry) {
      return entry.first->name() == control.name;
    });
    const lc::ControlValue value =
        found == known.end() ? lc::ControlValue() : ValueOf(found->first->type(), control.value);
    if (value.isNone()) {
      remarks.push_back("control " + control.name + ": the camera has none that takes a number");
    } else {
      list.set(found->first->id(), value);
    }
  }
  if (settings.rate > 0 && known.count(lc::controls::FrameDurationLimits.id()) > 0) {
    const auto duration_us = static_cast<std::int64_t>(1e6 / settings.rate);
    const std::int64_t limits[] = {duration_us, duration_us};
    list.set(lc::controls::FrameDurationLimits, lc::Span<const std::int64_t, 2>(limits));
    rate_ = settings.rate;
  } else if (settings.rate > 0) {
    remarks.push_back("the rate stays as it is");
  }
  return list;
}

Status LibcameraStream::MapBuffers() {
  lc::Stream* stream = configuration_->at(0).stream();
  allocator_ = std::make_unique<lc::FrameBufferAllocator>(camera_);
  if (allocator_->allocate(stream) < 0) return Failed("camera gives no buffers");
  for (const std::unique_ptr<lc::FrameBuffer>& buffer : allocator_->buffers(stream)) {
    if (Status status = MapBuffer(buffer.get()); !status.ok()) return status;
    slots_.back().request = camera_->createRequest(slots_.size() - 1);
    if (slots_.back().request == nullptr ||
        slots_.back().request->addBuffer(stream, buffer.get()) != 0) {
      return Failed("camera takes no request");
    }
  }
  return {};
}

// Luma stands in the first plane of every format that we read, chroma in those that follow it at
// once.
Status LibcameraStream::MapBuffer(lc::FrameBuffer* buffer) {
  if (buffer->planes().empty()) return Failed("camera gives no memory");
  const lc::FrameBuffer::Plane& plane = buffer->planes()[0];
  std::size_t length = std::size_t{plane.offset} + plane.length;
  const bool tight = plane.length == format_.row_bytes * std::size_t(format_.height);
  for (const lc::FrameBuffer::Plane& next : buffer->planes()) {
    if (tight && next.fd == plane.fd && next.offset == length) length += next.length;
  }
  void* memory = ::mmap(nullptr, length, PROT_READ, MAP_SHARED, plane.fd.get(), 0);
  if (memory == MAP_FAILED) return Failed("camera's memory cannot be mapped");
  slots_.push_back({nullptr, buffer, memory, length});
  return {};
}

Status LibcameraStream::Begin(const lc::ControlList& controls) {
  camera_->requestCompleted.connect(this, &LibcameraStream::OnCompleted);
  camera_->disconnected.connect(this, &LibcameraStream::OnDisconnected);
  if (camera_->start(&controls) != 0) return Failed("camera does not start");
  started_ = true;
  for (const Slot& slot : slots_) {
    if (camera_->queueRequest(slot.request.get()) != 0) return Failed("camera takes no request");
  }
  return {};
}

void LibcameraStream::OnCompleted(lc::Request* request) {
  if (request->status() == lc::Request::RequestCancelled) return;  // it is being stopped
  completed_.Push(static_cast<std::uint32_t>(request->cookie()));
}

std::string LibcameraStream::text() const {
  char text[96];
  std::snprintf(text, sizeof text, "%dx%d %s at %g/s, ", format_.width, format_.height,
                FourccText(format_.fourcc).c_str(), rate_);
  return text + ModelOf(*camera_) + " at " + camera_->id();
}

CameraStream::Dequeued LibcameraStream::Dequeue(Buffer& buffer) {
  const Dequeued dequeued = completed_.Pop(buffer.index);
  if (dequeued == Dequeued::kBroken) fault_ = Failed("camera is gone");
  if (dequeued != Dequeued::kBuffer) return dequeued;
  const Slot& slot = slots_[buffer.index];
  const lc::FrameMetadata& metadata = slot.buffer->metadata();
  const std::size_t begin = slot.buffer->planes()[0].offset;
  std::size_t size = slot.length - begin;
  if (metadata.planes().size() == 1)
    size = std::min<std::size_t>(size, metadata.planes()[0].bytesused);
  buffer.image = format_;
  buffer.image.bytes = {static_cast<const std::uint8_t*>(slot.memory) + begin, size};
  buffer.sequence = metadata.sequence;
  buffer.time_ns = static_cast<std::int64_t>(metadata.timestamp);
  buffer.erroneous = metadata.status != lc::FrameMetadata::FrameSuccess;
  return Dequeued::kBuffer;
}

bool LibcameraStream::Return(const Buffer& buffer) {
  lc::Request* request = slots_[buffer.index].request.get();
  request->reuse(lc::Request::ReuseBuffers);
  if (camera_->queueRequest(request) == 0) return true;
  fault_ = Failed("camera takes no request");
  return false;
}

void DescribeFormats(lc::Camera& camera, std::string& text) {
  const auto configuration = camera.generateConfiguration({lc::StreamRole::Viewfinder});
  if (configuration == nullptr || configuration->empty()) return;
  const lc::StreamFormats& formats = configuration->at(0).formats();
  for (const lc::PixelFormat& format : formats.pixelformats()) {
    const std::uint32_t ours = V4l2FormatOf(format.fourcc());
    text.append("  format ").append(FourccText(ours != 0 ? ours : format.fourcc()));
    text.append("  ").append(format.toString());
    text.append(ours != 0 ? "\n" : " (viewfixd does not read it)\n");
    for (const lc::Size& size : formats.sizes(format)) {
      text.append("    ").append(size.toString()).append("\n");
    }
  }
}

}  // namespace

Result<std::unique_ptr<FrameSource>> MakeLibcameraCamera(const CameraSettings& settings) {
  const auto open =
      [settings](std::vector<std::string>& remarks) -> Result<std::unique_ptr<CameraStream>> {
    // Anew where none streams: without udev, a manager never sees what was plugged in later.
    std::shared_ptr<lc::CameraManager> manager = SharedManager();
    if (manager == nullptr) return Status(StatusCode::kIo, "libcamera does not start");
    std::shared_ptr<lc::Camera> camera = FindCamera(*manager, settings.where);
    if (camera == nullptr) {
      return Status(StatusCode::kNotFound, "no such camera", "libcamera:" + settings.where);
    }
    return LibcameraStream::Start(std::move(manager), std::move(camera), settings, remarks);
  };
  return MakeLiveCamera(open, settings, SleptNs);
}

std::string DescribeLibcameraCameras() {
  const std::shared_ptr<lc::CameraManager> manager = SharedManager();
  std::string text;
  if (manager == nullptr) return text;
  for (const std::shared_ptr<lc::Camera>& camera : manager->cameras()) {
    text.append("libcamera:").append(camera->id()).append("  ").append(ModelOf(*camera));
    text.append("\n");
    DescribeFormats(*camera, text);
    for (const auto& [id, info] : camera->controls()) {
      text.append("  control ").append(id->name()).append("  ").append(info.toString());
      text.append("\n");
    }
  }
  return text;
}

}  // namespace viewfix
