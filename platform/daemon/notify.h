// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace viewfix {

// The service manager's side of sd_notify(3), written out because a static program has no
// libsystemd. Without a service manager nothing is sent.
class Notifier {
 public:
  // Reads NOTIFY_SOCKET, WATCHDOG_USEC and WATCHDOG_PID of the environment.
  Notifier();
  ~Notifier();
  Notifier(const Notifier&) = delete;
  Notifier& operator=(const Notifier&) = delete;

  // Sends lines such as "READY=1\nSTATUS=...". Never waits; a message that cannot be sent is lost.
  void Send(std::string_view message) const;
  // How often the watchdog is to be fed at most apart; 0: there is none.
  std::int64_t watchdog_ns() const { return watchdog_ns_; }

 private:
  int fd_ = -1;
  std::string address_;  // as in sockaddr_un::sun_path, an abstract one with '\0' in front
  std::int64_t watchdog_ns_ = 0;
};

}  // namespace viewfix
