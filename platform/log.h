// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <mutex>
#include <string_view>

#include "engine/base/status.h"

namespace viewfix {

// As syslog numbers them, so that the journal shows them apart.
enum class LogLevel { kError = 3, kWarning = 4, kInfo = 6 };

// One line on stderr after the program's name, control characters replaced. Where stderr is the
// journal, the level stands before it as sd-daemon(3) wants. Thread-safe.
void LogLine(LogLevel level, std::string_view text);

// "text: detail" as an error.
void PrintFault(const Status& status);

// For what may happen with every frame: kBurst lines at once, then one a second; the next line
// that passes says how many were left out. Thread-safe.
class LimitedLog {
 public:
  static constexpr int kBurst = 10;

  // Without a limit every line passes.
  explicit LimitedLog(bool limited) : limited_(limited) {}
  void Write(LogLevel level, std::string_view text);
  void Write(const Status& fault);

  // Whether a line may pass at this time, and how many were held back before it.
  bool Admit(std::int64_t now_ns, std::uint64_t& held_back);

 private:
  const bool limited_;
  std::mutex mutex_;
  double tokens_ = kBurst;
  std::int64_t last_ns_ = 0;
  std::uint64_t held_back_ = 0;
};

}  // namespace viewfix
