// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/cli/password.h"

#include <termios.h>
#include <unistd.h>

#include <cstdio>
#include <iostream>

#include "firmware_tools/dataset/image_set.h"

namespace viewfix {
namespace {

// Restores the terminal whatever happens.
class HiddenTyping {
 public:
  HiddenTyping() : terminal_(tcgetattr(STDIN_FILENO, &before_) == 0) {
    if (!terminal_) return;
    termios hidden = before_;
    hidden.c_lflag &= ~static_cast<tcflag_t>(ECHO);
    tcsetattr(STDIN_FILENO, TCSAFLUSH, &hidden);
  }
  ~HiddenTyping() {
    if (!terminal_) return;
    tcsetattr(STDIN_FILENO, TCSAFLUSH, &before_);
    std::fputc('\n', stderr);
  }
  HiddenTyping(const HiddenTyping&) = delete;
  HiddenTyping& operator=(const HiddenTyping&) = delete;
  bool terminal() const { return terminal_; }

 private:
  termios before_ = {};
  bool terminal_;
};

}  // namespace

std::string AskPassword(const std::string& prompt) {
  const HiddenTyping hidden;
  if (hidden.terminal()) std::fprintf(stderr, "%s: ", prompt.c_str());
  std::string line;
  if (!std::getline(std::cin, line)) throw ToolError("a password is needed: none was given");
  return line;
}

}  // namespace viewfix
