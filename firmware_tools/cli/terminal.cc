// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/cli/terminal.h"

#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>

#include "firmware_tools/dataset/image_set.h"

namespace viewfix {
namespace {

using Clock = std::chrono::steady_clock;

volatile std::sig_atomic_t g_interrupted = 0;

void OnInterrupt(int /*signal*/) { g_interrupted = 1; }

class Bar {
 public:
  explicit Bar(std::string stage) : stage_(std::move(stage)), terminal_(isatty(STDERR_FILENO)) {
    if (!terminal_) std::fprintf(stderr, "%s ...\n", stage_.c_str());
  }

  void Show(int done, int total) {
    if (g_interrupted != 0) throw ToolError("interrupted; no result was written");
    const auto now = Clock::now();
    const bool last = done == total;
    const bool due = now - shown_ > std::chrono::milliseconds(100);
    if (last && !ended_) {
      End(total, now);
    } else if (terminal_ && due && !last) {
      Draw(done, total, now);
      shown_ = now;
    }
  }

 private:
  double Seconds(Clock::time_point now) const {
    return std::chrono::duration<double>(now - begin_).count();
  }

  void Draw(int done, int total, Clock::time_point now) const {
    constexpr int kWidth = 30;
    const double share = static_cast<double>(done) / total;
    const int filled = static_cast<int>(share * kWidth);
    const double left = done == 0 ? 0 : Seconds(now) * (1 - share) / share;
    std::fprintf(stderr, "\r\033[K%-18s [%.*s%*s] %d/%d, %.0f s left", stage_.c_str(), filled,
                 "##############################", kWidth - filled, "", done, total, left);
  }

  void End(int total, Clock::time_point now) {
    ended_ = true;
    std::fprintf(stderr, "%s%-18s %d done in %.1f s\n", terminal_ ? "\r\033[K" : "", stage_.c_str(),
                 total, Seconds(now));
  }

  std::string stage_;
  bool terminal_;
  bool ended_ = false;
  Clock::time_point begin_ = Clock::now();
  Clock::time_point shown_ = begin_;
};

}  // namespace

void CatchInterrupts() {
  struct sigaction action = {};
  action.sa_handler = OnInterrupt;
  action.sa_flags = SA_RESETHAND;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

Progress ShowProgress(const std::string& stage) {
  auto bar = std::make_shared<Bar>(stage);
  return [bar](int done, int total) { bar->Show(done, total); };
}

void CheckCanWrite(const std::string& file) {
  const std::filesystem::path folder = std::filesystem::absolute(file).parent_path();
  if (!std::filesystem::is_directory(folder)) {
    throw ToolError(file + ": cannot write: the folder " + folder.string() + " does not exist");
  }
  if (std::filesystem::is_directory(file)) throw ToolError(file + ": cannot write: it is a folder");
  if (access(folder.c_str(), W_OK) != 0) {
    throw ToolError(file + ": cannot write: " + std::strerror(errno));
  }
}

}  // namespace viewfix
