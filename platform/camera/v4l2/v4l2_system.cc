// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/v4l2/v4l2_system.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <system_error>

namespace viewfix {
namespace {

namespace fs = std::filesystem;

constexpr const char* kStableFolders[] = {"/dev/v4l/by-id", "/dev/v4l/by-path"};

// "/dev/video10" -> 10; -1: no video node.
int NumberOf(const fs::path& path) {
  const std::string name = path.filename().string();
  if (name.rfind("video", 0) != 0 || name.size() == 5 || name.size() > 12) return -1;
  int number = 0;
  for (const char c : name.substr(5)) {
    if (c < '0' || c > '9') return -1;
    number = number * 10 + (c - '0');
  }
  return number;
}

class RealSystem : public V4l2System {
 public:
  int Open(const char* path) override { return ::open(path, O_RDWR | O_NONBLOCK | O_CLOEXEC); }
  int Close(int fd) override { return ::close(fd); }

  int Ioctl(int fd, unsigned long request, void* argument) override {
    int result = 0;
    do {
      result = ::ioctl(fd, request, argument);
    } while (result < 0 && errno == EINTR);
    return result;
  }

  int Poll(int fd, int wake_fd, int timeout_ms) override {
    pollfd waiting[] = {{fd, POLLIN, 0}, {wake_fd, POLLIN, 0}};
    const int ready = ::poll(waiting, wake_fd >= 0 ? 2 : 1, timeout_ms);
    if (ready < 0) return errno == EINTR ? 0 : -1;
    return waiting[0].revents;
  }

  void* Map(int fd, std::size_t length, std::size_t offset) override {
    void* memory =
        ::mmap(nullptr, length, PROT_READ | PROT_WRITE, MAP_SHARED, fd, static_cast<off_t>(offset));
    return memory == MAP_FAILED ? nullptr : memory;
  }
  void Unmap(void* memory, std::size_t length) override { ::munmap(memory, length); }

  std::vector<std::string> Nodes() override {
    std::vector<fs::path> nodes;
    std::error_code error;
    for (const fs::directory_entry& entry : fs::directory_iterator("/dev", error)) {
      if (NumberOf(entry.path()) >= 0) nodes.push_back(entry.path());
    }
    std::sort(nodes.begin(), nodes.end(),
              [](const fs::path& a, const fs::path& b) { return NumberOf(a) < NumberOf(b); });
    return {nodes.begin(), nodes.end()};
  }

  std::string Resolve(const std::string& path) override {
    std::error_code error;
    const fs::path real = fs::canonical(path, error);
    return error ? std::string() : real.string();
  }

  std::vector<std::string> StableNames(const std::string& node) override {
    std::vector<std::string> names;
    for (const char* folder : kStableFolders) {
      std::error_code error;
      for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
        if (Resolve(entry.path().string()) == node) names.push_back(entry.path().string());
      }
    }
    std::sort(names.begin(), names.end());
    return names;
  }
};

}  // namespace

V4l2System& RealV4l2System() {
  static RealSystem system;
  return system;
}

}  // namespace viewfix
