// SPDX-License-Identifier: BSD-3-Clause
#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "platform/publish/publisher.h"

namespace viewfix {
namespace {

class StreamPublisher : public Publisher {
 public:
  explicit StreamPublisher(int fd) : fd_(fd) {}

  Status Publish(std::string_view line) override {
    while (!line.empty()) {
      const ssize_t written = ::write(fd_, line.data(), line.size());
      if (written >= 0) {
        line.remove_prefix(static_cast<std::size_t>(written));
      } else if (errno != EAGAIN || !WaitUntilWritable()) {
        return Refused(errno);
      }
    }
    return {};
  }

 private:
  static Status Refused(int error) {
    const bool end = error == EPIPE || error == EINTR;
    return {end ? StatusCode::kCancelled : StatusCode::kIo, "cannot write the output",
            std::strerror(error)};
  }

  bool WaitUntilWritable() const {
    pollfd waiting = {fd_, POLLOUT, 0};
    return ::poll(&waiting, 1, -1) > 0;
  }

  int fd_;
};

}  // namespace

std::unique_ptr<Publisher> MakeStreamPublisher(int fd) {
  return std::make_unique<StreamPublisher>(fd);
}

}  // namespace viewfix
