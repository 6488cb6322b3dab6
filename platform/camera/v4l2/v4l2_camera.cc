// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/v4l2/v4l2_camera.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <utility>
#include <vector>

#include "platform/clock.h"
#include "platform/log.h"

namespace viewfix {
namespace {

constexpr std::int64_t kMillisecondNs = 1'000'000;
constexpr int kFrameTimeoutMs = 1000;
constexpr int kMaxTimeouts = 3;  // in a row, before the stream is started anew
constexpr std::int64_t kFirstBackOffNs = 100 * kMillisecondNs;
constexpr std::int64_t kLastBackOffNs = 1000 * kMillisecondNs;

std::string FormatText(const V4l2Stream& stream) {
  const StreamFormat& format = stream.format();
  char text[96];
  std::snprintf(text, sizeof text, "%dx%d %s at %g/s, ", format.width, format.height,
                FourccText(format.fourcc).c_str(), format.rate);
  return text + stream.node().identity().card + " at " + stream.node().path();
}

class V4l2Camera : public FrameSource {
 public:
  V4l2Camera(V4l2System& system, CameraSettings settings)
      : system_(system),
        settings_(std::move(settings)),
        wake_fd_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}
  ~V4l2Camera() override {
    if (wake_fd_ >= 0) ::close(wake_fd_);
  }

  Status Next(Frame& frame) override;
  bool live() const override { return true; }
  void SetMinInterval(std::int64_t interval_ns) override { min_interval_ns_ = interval_ns; }
  void Wake() override { (void)::eventfd_write(wake_fd_, 1); }
  CameraCondition condition() const override { return condition_; }
  CameraCounts counts() const override { return counts_; }

 private:
  using Buffer = V4l2Stream::Buffer;
  using Dequeued = V4l2Stream::Dequeued;

  void Connect();
  void Fail(const Status& why);
  bool WaitToRetry();
  Dequeued TakeNewest(std::optional<Buffer>& newest);
  void Count(const Buffer& buffer);
  bool Wanted(const Buffer& buffer);
  Status Deliver(const Buffer& buffer, Frame& frame);

  V4l2System& system_;
  const CameraSettings settings_;
  const int wake_fd_;
  std::unique_ptr<V4l2Stream> stream_;  // null: not there
  std::optional<CameraIdentity> identity_;
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

Status V4l2Camera::Next(Frame& frame) {
  if (stream_ == nullptr && WaitToRetry()) Connect();
  if (stream_ == nullptr) return Nothing();
  const int events = system_.Poll(stream_->node().fd(), wake_fd_, kFrameTimeoutMs);
  if (eventfd_t woken = 0; ::eventfd_read(wake_fd_, &woken) == 0) return Nothing();
  if (events == 0) {
    ++counts_.timeouts;
    if (++timeouts_ >= kMaxTimeouts) Fail({StatusCode::kIo, "camera sends no frames"});
    return Nothing();
  }
  std::optional<Buffer> newest;
  if (events < 0 || TakeNewest(newest) == Dequeued::kBroken) {
    Fail(events < 0 ? stream_->node().Failed("poll") : stream_->fault());
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
bool V4l2Camera::WaitToRetry() {
  const std::int64_t wait_ns = retry_at_ns_ - MonotonicNs();
  if (wait_ns <= 0) return true;
  pollfd waiting = {wake_fd_, POLLIN, 0};
  (void)::poll(&waiting, 1, static_cast<int>(wait_ns / kMillisecondNs) + 1);
  eventfd_t woken = 0;
  return ::eventfd_read(wake_fd_, &woken) != 0 && MonotonicNs() >= retry_at_ns_;
}

void V4l2Camera::Connect() {
  Result<V4l2Node> node = FindCamera(system_, settings_.where, identity_);
  if (!node.ok()) return Fail(node.status());
  const CameraIdentity identity = node->identity();
  std::vector<std::string> remarks;
  Result<std::unique_ptr<V4l2Stream>> stream =
      V4l2Stream::Start(std::move(*node), settings_, remarks);
  if (!stream.ok()) return Fail(stream.status());
  stream_ = std::move(*stream);
  if (identity_) ++counts_.reconnects;
  // Once said is enough, however often it comes back.
  if (!identity_) {
    for (const std::string& remark : remarks) LogLine(LogLevel::kWarning, "camera: " + remark);
  }
  identity_ = identity;
  timeouts_ = 0;
  driver_sequence_.reset();
  condition_ = {true, FormatText(*stream_)};
}

void V4l2Camera::Fail(const Status& why) {
  stream_.reset();
  condition_.present = false;
  condition_.text = why.text();
  if (!why.detail().empty()) condition_.text.append(": ").append(why.detail());
  retry_at_ns_ = MonotonicNs() + back_off_ns_;
  back_off_ns_ = std::min(2 * back_off_ns_, kLastBackOffNs);
}

// All that are filled: the last is the one, those before it go back undecoded.
V4l2Camera::Dequeued V4l2Camera::TakeNewest(std::optional<Buffer>& newest) {
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

void V4l2Camera::Count(const Buffer& buffer) {
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

bool V4l2Camera::Wanted(const Buffer& buffer) {
  const std::int64_t time_ns = buffer.time_ns != 0 ? buffer.time_ns : MonotonicNs();
  const std::int64_t passed_ns = time_ns - delivered_ns_;
  // A tenth early is not too early: cameras do not keep time to the microsecond. A clock that
  // went back is one of a driver that began anew.
  return passed_ns < 0 || passed_ns >= min_interval_ns_ - min_interval_ns_ / 10;
}

Status V4l2Camera::Deliver(const Buffer& buffer, Frame& frame) {
  if (!Wanted(buffer)) {
    ++counts_.skipped;
    return Nothing();
  }
  const int enough_side = std::max(settings_.width, settings_.height);
  const Status status = ToGrey(buffer.image, enough_side, frame.image);
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

std::unique_ptr<FrameSource> MakeV4l2Camera(V4l2System& system, const CameraSettings& settings) {
  return std::make_unique<V4l2Camera>(system, settings);
}

}  // namespace viewfix
