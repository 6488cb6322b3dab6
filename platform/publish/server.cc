// SPDX-License-Identifier: BSD-3-Clause
#include "platform/publish/server.h"

#include <event2/event.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <atomic>
#include <deque>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "platform/log.h"
#include "platform/publish/draw_features.h"
#include "platform/publish/event_handles.h"
#include "platform/publish/http_output.h"
#include "platform/publish/unix_output.h"

namespace viewfix {
namespace {

// Lines that wait for the server's thread; more than this, and the oldest go.
constexpr std::size_t kMaxInbox = 256;
constexpr timeval kBeatInterval = {0, 500'000};
constexpr int kPictureQuality = 75;

void OnLibraryMessage(int severity, const char* text) {
  if (severity >= EVENT_LOG_WARN) LogLine(LogLevel::kWarning, text);
}

}  // namespace

class Server::Impl {
 public:
  explicit Impl(ServerContent content) : content_(std::move(content)) {}
  ~Impl();

  Status Open(const PublishSettings& settings);
  void Start() {
    thread_ = std::thread([this] { event_base_dispatch(base_.get()); });
  }
  void Publish(std::string_view line);
  void Show(const YuvImage& frame, std::span<const SeenPoint> points);
  PublishCounts counts() const;

 private:
  static void OnWake(evutil_socket_t fd, short, void* self);
  static void OnBeat(evutil_socket_t, short, void* self);
  Status OpenHttp(const PublishSettings& settings);
  void SendWaiting();
  void ShareCounts();
  std::vector<std::uint8_t> FrameJpeg();

  ServerContent content_;
  int wake_fd_ = -1;
  EventHandle<event_base> base_;
  EventHandle<event> wake_event_, beat_event_;
  PublishCounts own_counts_;  // of the thread
  std::optional<UnixOutput> unix_;
  std::optional<HttpOutput> http_;
  std::thread thread_;
  std::atomic<bool> stop_ = false;

  mutable std::mutex mutex_;
  std::deque<std::string> inbox_;
  std::uint64_t inbox_dropped_ = 0;
  PublishCounts counts_;
  YuvImage frame_;
  std::vector<SeenPoint> points_;  // of frame_
};

Server::Impl::~Impl() {
  stop_ = true;
  if (wake_fd_ >= 0) (void)::eventfd_write(wake_fd_, 1);
  if (thread_.joinable()) thread_.join();
  http_.reset();
  unix_.reset();
  wake_event_.reset();
  beat_event_.reset();
  base_.reset();
  if (wake_fd_ >= 0) ::close(wake_fd_);
}

Status Server::Impl::Open(const PublishSettings& settings) {
  event_set_log_callback(OnLibraryMessage);
  base_.reset(event_base_new());
  wake_fd_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  if (base_ == nullptr || wake_fd_ < 0) return {StatusCode::kIo, "no descriptors for the server"};
  wake_event_.reset(event_new(base_.get(), wake_fd_, EV_READ | EV_PERSIST, OnWake, this));
  beat_event_.reset(event_new(base_.get(), -1, EV_PERSIST, OnBeat, this));
  event_add(wake_event_.get(), nullptr);
  event_add(beat_event_.get(), &kBeatInterval);
  if (!settings.unix_path.empty()) {
    unix_.emplace(base_.get(), own_counts_);
    if (Status status = unix_->Listen(settings.unix_path); !status.ok()) return status;
  }
  return settings.http_port != 0 ? OpenHttp(settings) : Status();
}

Status Server::Impl::OpenHttp(const PublishSettings& settings) {
  std::string token;
  if (!settings.token_file.empty()) {
    Result<std::string> read = ReadToken(settings.token_file);
    if (!read.ok()) return read.status();
    token = std::move(*read);
  }
  std::function<std::vector<std::uint8_t>()> picture;
  if (settings.frame_picture) picture = [this] { return FrameJpeg(); };
  http_.emplace(base_.get(), own_counts_, content_, std::move(picture));
  return http_->Listen(settings.http_address, settings.http_port, token);
}

void Server::Impl::OnWake(evutil_socket_t fd, short, void* self) {
  auto* server = static_cast<Impl*>(self);
  eventfd_t count = 0;
  (void)::eventfd_read(fd, &count);
  if (server->stop_) {
    event_base_loopbreak(server->base_.get());
    return;
  }
  server->SendWaiting();
  server->ShareCounts();
}

void Server::Impl::OnBeat(evutil_socket_t, short, void* self) {
  auto* server = static_cast<Impl*>(self);
  server->content_.beat();
  server->ShareCounts();
}

void Server::Impl::SendWaiting() {
  std::deque<std::string> lines;
  {
    const std::lock_guard lock(mutex_);
    lines.swap(inbox_);
  }
  for (const std::string& line : lines) {
    ++own_counts_.lines;
    if (unix_) unix_->Send(line);
    if (http_) http_->Send(line);
  }
}

void Server::Impl::ShareCounts() {
  const std::lock_guard lock(mutex_);
  counts_ = own_counts_;
  counts_.dropped_lines += inbox_dropped_;
}

void Server::Impl::Publish(std::string_view line) {
  {
    const std::lock_guard lock(mutex_);
    if (inbox_.size() >= kMaxInbox) {
      inbox_.pop_front();
      ++inbox_dropped_;
    }
    inbox_.emplace_back(line);
  }
  (void)::eventfd_write(wake_fd_, 1);
}

void Server::Impl::Show(const YuvImage& frame, std::span<const SeenPoint> points) {
  const std::lock_guard lock(mutex_);
  frame_ = frame;
  points_.assign(points.begin(), points.end());
}

std::vector<std::uint8_t> Server::Impl::FrameJpeg() {
  YuvImage frame;
  std::vector<SeenPoint> points;
  {
    const std::lock_guard lock(mutex_);
    frame = frame_;
    points = points_;
  }
  return frame.pixels.empty() ? std::vector<std::uint8_t>()
                              : EncodeJpeg(DrawFeatures(frame, points), kPictureQuality);
}

PublishCounts Server::Impl::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

Server::Server(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Server::~Server() = default;

Result<std::unique_ptr<Server>> Server::Start(const PublishSettings& settings,
                                              ServerContent content) {
  auto impl = std::make_unique<Impl>(std::move(content));
  if (Status status = impl->Open(settings); !status.ok()) return status;
  impl->Start();
  return std::unique_ptr<Server>(new Server(std::move(impl)));
}

Status Server::Publish(std::string_view line) {
  impl_->Publish(line);
  return {};
}

void Server::Show(const YuvImage& frame, std::span<const SeenPoint> points) {
  impl_->Show(frame, points);
}

PublishCounts Server::counts() const { return impl_->counts(); }

}  // namespace viewfix
