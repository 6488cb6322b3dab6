// SPDX-License-Identifier: BSD-3-Clause
#include <limits.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include "platform/publish/publisher.h"

namespace viewfix {
namespace {

constexpr int kAskEveryMs = 200;

Status Refused(int error) {
  const bool end = error == EPIPE || error == EINTR;
  return {end ? StatusCode::kCancelled : StatusCode::kIo, "cannot write the output",
          std::strerror(error)};
}

bool Writable(int fd, int timeout_ms) {
  pollfd waiting = {fd, POLLOUT, 0};
  return ::poll(&waiting, 1, timeout_ms) > 0;
}

// As much as a pipe takes without waiting once poll() has said that it is writable.
ssize_t WritePiece(int fd, std::string_view text) {
  return ::write(fd, text.data(), std::min<std::size_t>(text.size(), PIPE_BUF));
}

class StreamPublisher : public Publisher {
 public:
  StreamPublisher(int fd, std::function<bool()> go_on) : fd_(fd), go_on_(std::move(go_on)) {}

  Status Publish(std::string_view line) override {
    while (!line.empty()) {
      while (!Writable(fd_, kAskEveryMs)) {
        if (go_on_ && !go_on_()) return {StatusCode::kCancelled, "the output is not read"};
      }
      const ssize_t written = WritePiece(fd_, line);
      if (written < 0 && errno == EAGAIN) continue;
      if (written < 0) return Refused(errno);
      line.remove_prefix(static_cast<std::size_t>(written));
    }
    return {};
  }

 private:
  int fd_;
  std::function<bool()> go_on_;
};

class DroppingPublisher : public Publisher {
 public:
  explicit DroppingPublisher(int fd) : fd_(fd) {}

  Status Publish(std::string_view line) override {
    if (waiting_.size() + line.size() <= kMaxWaitingBytes) waiting_.append(line);
    std::size_t done = 0;
    while (done < waiting_.size() && Writable(fd_, 0)) {
      const ssize_t written = WritePiece(fd_, std::string_view(waiting_).substr(done));
      if (written < 0 && errno != EAGAIN && errno != EINTR) return Refused(errno);
      if (written < 0) break;
      done += static_cast<std::size_t>(written);
    }
    waiting_.erase(0, done);
    return {};
  }

 private:
  int fd_;
  std::string waiting_;
};

class Fan : public Publisher {
 public:
  explicit Fan(std::vector<std::unique_ptr<Publisher>> outputs) : outputs_(std::move(outputs)) {}

  Status Publish(std::string_view line) override {
    for (const auto& output : outputs_) {
      if (Status status = output->Publish(line); !status.ok()) return status;
    }
    return {};
  }

 private:
  std::vector<std::unique_ptr<Publisher>> outputs_;
};

}  // namespace

std::unique_ptr<Publisher> MakeStreamPublisher(int fd, std::function<bool()> go_on) {
  return std::make_unique<StreamPublisher>(fd, std::move(go_on));
}

std::unique_ptr<Publisher> MakeFan(std::vector<std::unique_ptr<Publisher>> outputs) {
  return std::make_unique<Fan>(std::move(outputs));
}

std::unique_ptr<Publisher> MakeDroppingPublisher(int fd) {
  return std::make_unique<DroppingPublisher>(fd);
}

}  // namespace viewfix
