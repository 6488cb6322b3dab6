// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/live_camera.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "platform/camera/v4l2/to_yuv.h"
#include "platform/clock.h"
#include "platform/log.h"

namespace viewfix {
namespace {

constexpr std::int64_t kMillisecondNs = 1'000'000;
constexpr int kFrameTimeoutMs = 1000;
constexpr int kMaxTimeouts = 3;  // in a row, before the stream is started anew
constexpr std::int64_t kFirstBackOffNs = 100 * kMillisecondNs;
constexpr std::int64_t kLastBackOffNs = 1000 * kMillisecondNs;

// A shorter sleep is none: clocks are read one after the other.
constexpr std::int64_t kShortestSleepNs = 100 * kMillisecondNs;

class LiveCamera : public FrameSource {
 public:
  LiveCamera(StreamOpener open, const CameraSettings& settings,
             std::function<std::int64_t()> asleep_ns)
      : open_(std::move(open)),
        enough_side_(std::max(settings.width, settings.height)),
        asleep_ns_(std::move(asleep_ns)),
        slept_ns_(asleep_ns_()),
        wake_fd_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}
  ~LiveCamera() override {
    if (wake_fd_ >= 0) ::close(wake_fd_);
  }

  Status Next(Frame& frame) override;
  bool live() const override { return true; }
  void SetMinInterval(std::int64_t interval_ns) override { min_interval_ns_ = interval_ns; }
  void Wake() override { (void)::eventfd_write(wake_fd_, 1); }
  CameraCondition condition() const override { return condition_; }
  CameraCounts counts() const override { return counts_; }

 private:
  using Buffer = CameraStream::Buffer;
  using Dequeued = CameraStream::Dequeued;

  void Connect();
  bool HasSlept();
  Status StartAnew();
  void Fail(Status why);
  bool WaitToRetry();
  Dequeued TakeNewest(std::optional<Buffer>& newest);
  void Count(const Buffer& buffer);
  bool Wanted(const Buffer& buffer);
  Status Deliver(const Buffer& buffer, Frame& frame);

  const StreamOpener open_;
  const int enough_side_;  // pixels: larger frames may be shrunk to this
  const std::function<std::int64_t()> asleep_ns_;
  std::int64_t slept_ns_;
  const int wake_fd_;
  std::unique_ptr<CameraStream> stream_;  // null: not there
  bool was_open_ = false;
  CameraCondition condition_ = {false, "not opened yet"};
  CameraCounts counts_;
  std::int64_t retry_at_ns_ = 0;
  std::int64_t back_off_ns_ = kFirstBackOffNs;
  int timeouts_ = 0;  // in a row
  std::int64_t min_interval_ns_ = 0;
  std::int64_t delivered_ns_ = 0;
  // The driver's count begins anew with every stream; ours goes on.
  std::optional<std::uint32_t> driver_sequence_;
  std::uint64_t sequence_ = 0;
};

Status Nothing() { return {StatusCode::kCancelled, "no frame"}; }

Status LiveCamera::Next(Frame& frame) {
  if (HasSlept()) return StartAnew();
  if (stream_ == nullptr && WaitToRetry()) Connect();
  if (stream_ == nullptr) return Nothing();
  const int events = stream_->Wait(wake_fd_, kFrameTimeoutMs);
  if (eventfd_t woken = 0; ::eventfd_read(wake_fd_, &woken) == 0) return Nothing();
  if (HasSlept()) return StartAnew();
  if (events == 0) {
    ++counts_.timeouts;
    if (++timeouts_ >= kMaxTimeouts) Fail({StatusCode::kIo, "camera sends no frames"});
    return Nothing();
  }
  std::optional<Buffer> newest;
  if (events < 0 || TakeNewest(newest) == Dequeued::kBroken) {
    Fail(stream_->fault());
    return Nothing();
  }
  if (!newest) {
    // An error without a buffer: DQBUF did not say which, but poll() would return at once forever.
    if ((events & (POLLERR | POLLHUP)) != 0) Fail({StatusCode::kIo, "camera reports an error"});
    return Nothing();
  }
  const Status status = Deliver(*newest, frame);
  if (!stream_->Return(*newest)) Fail(stream_->fault());
  return status;
}

// False: woken, or not yet.
bool LiveCamera::WaitToRetry() {
  const std::int64_t wait_ns = retry_at_ns_ - MonotonicNs();
  if (wait_ns <= 0) return true;
  pollfd waiting = {wake_fd_, POLLIN, 0};
  (void)::poll(&waiting, 1, static_cast<int>(wait_ns / kMillisecondNs) + 1);
  eventfd_t woken = 0;
  return ::eventfd_read(wake_fd_, &woken) != 0 && MonotonicNs() >= retry_at_ns_;
}

void LiveCamera::Connect() {
  std::vector<std::string> remarks;
  Result<std::unique_ptr<CameraStream>> stream = open_(remarks);
  if (!stream.ok()) return Fail(stream.status());
  stream_ = std::move(*stream);
  if (was_open_) ++counts_.reconnects;
  // Once said is enough, however often it comes back.
  if (!was_open_) {
    for (const std::string& remark : remarks) LogLine(LogLevel::kWarning, "camera: " + remark);
  }
  was_open_ = true;
  timeouts_ = 0;
  driver_sequence_.reset();
  condition_ = {true, stream_->text()};
}

// Frames from before a sleep look fresh, as the clock stood still; and many drivers come back
// without their settings, or not at all.
bool LiveCamera::HasSlept() {
  const std::int64_t slept_ns = asleep_ns_();
  return slept_ns - std::exchange(slept_ns_, slept_ns) >= kShortestSleepNs;
}

Status LiveCamera::StartAnew() {
  Fail({StatusCode::kIo, "the machine was asleep"});
  retry_at_ns_ = 0;
  back_off_ns_ = kFirstBackOffNs;
  return Nothing();
}

// By value: the stream may own it.
void LiveCamera::Fail(Status why) {
  stream_.reset();
  condition_.present = false;
  condition_.text = why.text();
  if (!why.detail().empty()) condition_.text.append(": ").append(why.detail());
  retry_at_ns_ = MonotonicNs() + back_off_ns_;
  back_off_ns_ = std::min(2 * back_off_ns_, kLastBackOffNs);
}

// All that are filled: the last is the one, those before it go back undecoded.
LiveCamera::Dequeued LiveCamera::TakeNewest(std::optional<Buffer>& newest) {
  while (true) {
    Buffer buffer;
    const Dequeued dequeued = stream_->Dequeue(buffer);
    if (dequeued == Dequeued::kNone) return newest ? Dequeued::kBuffer : Dequeued::kNone;
    if (dequeued == Dequeued::kBroken) return dequeued;
    Count(buffer);
    Buffer back = buffer;
    if (!buffer.erroneous) {
      if (newest) ++counts_.skipped;
      if (!newest) {
        newest = buffer;
        continue;
      }
      std::swap(back, *newest);
    } else {
      ++counts_.erroneous;
    }
    if (!stream_->Return(back)) return Dequeued::kBroken;
  }
}

void LiveCamera::Count(const Buffer& buffer) {
  std::uint32_t step = 1;
  if (driver_sequence_) {
    // Some drivers never count; one that begins anew is no gap either.
    const std::uint32_t passed = buffer.sequence - *driver_sequence_;
    if (passed >= 1 && passed < 1U << 31) step = passed;
    counts_.lost += step - 1;
  }
  sequence_ += step;
  driver_sequence_ = buffer.sequence;
  timeouts_ = 0;
}

bool LiveCamera::Wanted(const Buffer& buffer) {
  const std::int64_t time_ns = buffer.time_ns != 0 ? buffer.time_ns : MonotonicNs();
  const std::int64_t passed_ns = time_ns - delivered_ns_;
  // A tenth early is not too early: cameras do not keep time to the microsecond. A clock that
  // went back is one of a driver that began anew.
  return passed_ns < 0 || passed_ns >= min_interval_ns_ - min_interval_ns_ / 10;
}

Status LiveCamera::Deliver(const Buffer& buffer, Frame& frame) {
  if (!Wanted(buffer)) {
    ++counts_.skipped;
    return Nothing();
  }
  const Status status = ToYuv(buffer.image, enough_side_, frame.image);
  if (!status.ok()) {
    ++counts_.truncated;
    return Nothing();
  }
  frame.sequence = sequence_ - 1;
  frame.name.clear();
  frame.capture_time_ns = buffer.time_ns != 0 ? buffer.time_ns : MonotonicNs();
  delivered_ns_ = frame.capture_time_ns;
  back_off_ns_ = kFirstBackOffNs;  // it works again
  ++counts_.delivered;
  return {};
}

}  // namespace

void RemarkFormat(const CameraSettings& settings, const std::string& pixel_format, int width,
                  int height, std::vector<std::string>& remarks) {
  const auto size_text = [](int w, int h) { return std::to_string(w) + "x" + std::to_string(h); };
  if (!settings.pixel_format.empty() && settings.pixel_format != pixel_format) {
    remarks.push_back("no pixel format " + settings.pixel_format + ", taking " + pixel_format);
  }
  if (width != settings.width || height != settings.height) {
    remarks.push_back("no size " + size_text(settings.width, settings.height) + ", taking " +
                      size_text(width, height));
  }
}

std::unique_ptr<FrameSource> MakeLiveCamera(StreamOpener open, const CameraSettings& settings,
                                            std::function<std::int64_t()> asleep_ns) {
  return std::make_unique<LiveCamera>(std::move(open), settings, std::move(asleep_ns));
}

}  // namespace viewfix
