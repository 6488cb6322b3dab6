// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <thread>

namespace viewfix {

// SIGHUP, SIGINT and SIGTERM for a loop of poll(), heard by a thread of their own. After one that
// ends it the process is gone within kEndMs, whatever its threads still wait for: a driver, a
// broker, a disk, a model that is being read.
class Signals {
 public:
  static constexpr int kEndMs = 170;  // those who stop us wait 200

  Signals() = default;
  ~Signals();  // an end that got here takes what time it needs
  Signals(const Signals&) = delete;
  Signals& operator=(const Signals&) = delete;

  // Before the first other thread: all inherit what is blocked here. False: no descriptors.
  bool Start();
  // Readable when there is something new to ask for.
  int fd() const { return wake_; }
  bool ending() const { return ending_; }
  // Whether a SIGHUP came since the last time; fd() is no longer readable.
  bool TakeReload();

 private:
  void Listen();
  void Read();

  int signals_ = -1;
  int wake_ = -1;
  int quit_ = -1;
  std::atomic<bool> ending_ = false;
  std::atomic<bool> reload_ = false;
  std::thread thread_;
};

}  // namespace viewfix
