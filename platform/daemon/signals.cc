// SPDX-License-Identifier: BSD-3-Clause
#include "platform/daemon/signals.h"

#include <poll.h>
#include <pthread.h>
#include <sys/eventfd.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>

namespace viewfix {

Signals::~Signals() {
  if (quit_ >= 0) (void)::eventfd_write(quit_, 1);
  if (thread_.joinable()) thread_.join();
  for (const int fd : {signals_, wake_, quit_}) {
    if (fd >= 0) ::close(fd);
  }
}

bool Signals::Start() {
  std::signal(SIGPIPE, SIG_IGN);
  sigset_t set;
  sigemptyset(&set);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&set, signal);
  ::pthread_sigmask(SIG_BLOCK, &set, nullptr);
  signals_ = ::signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK);
  wake_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  quit_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  if (signals_ < 0 || wake_ < 0 || quit_ < 0) return false;
  thread_ = std::thread([this] { Listen(); });
  return true;
}

bool Signals::TakeReload() {
  eventfd_t count = 0;
  (void)::eventfd_read(wake_, &count);
  return reload_.exchange(false);
}

void Signals::Listen() {
  pollfd waiting[] = {{quit_, POLLIN, 0}, {signals_, POLLIN, 0}};
  while (!ending_) {
    (void)::poll(waiting, 2, -1);
    if (waiting[0].revents != 0) return;
    Read();
  }
  if (::poll(waiting, 1, kEndMs) != 1) std::_Exit(0);  // whoever waits longer has failed nothing
}

void Signals::Read() {
  signalfd_siginfo info;
  while (::read(signals_, &info, sizeof info) == sizeof info) {
    if (info.ssi_signo == SIGHUP) {
      reload_ = true;
    } else {
      ending_ = true;
    }
  }
  (void)::eventfd_write(wake_, 1);
}

}  // namespace viewfix
