// SPDX-License-Identifier: BSD-3-Clause
#include "platform/log.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "platform/clock.h"

namespace viewfix {
namespace {

std::string TextOf(const Status& status) {
  std::string text(status.text());
  if (!status.detail().empty()) text.append(": ").append(status.detail());
  return text;
}

}  // namespace

void LogLine(LogLevel level, std::string_view text) {
  static const bool to_journal = std::getenv("JOURNAL_STREAM") != nullptr;
  std::string line = "viewfixd: ";
  line.append(text);
  // A file name may hold line ends and worse.
  std::replace_if(
      line.begin(), line.end(), [](unsigned char c) { return c < 0x20; }, '?');
  if (to_journal) {
    std::fprintf(stderr, "<%d>%s\n", static_cast<int>(level), line.c_str());
  } else {
    std::fprintf(stderr, "%s\n", line.c_str());
  }
}

void PrintFault(const Status& status) { LogLine(LogLevel::kError, TextOf(status)); }

bool LimitedLog::Admit(std::int64_t now_ns, std::uint64_t& held_back) {
  const std::lock_guard lock(mutex_);
  const double passed_s = static_cast<double>(now_ns - last_ns_) * 1e-9;
  last_ns_ = now_ns;
  tokens_ = std::min<double>(kBurst, tokens_ + passed_s);
  if (limited_ && tokens_ < 1) {
    ++held_back_;
    return false;
  }
  tokens_ -= 1;
  held_back = held_back_;
  held_back_ = 0;
  return true;
}

void LimitedLog::Write(LogLevel level, std::string_view text) {
  std::uint64_t held_back = 0;
  if (!Admit(MonotonicNs(), held_back)) return;
  std::string line(text);
  if (held_back > 0) line.append(" (and ").append(std::to_string(held_back)).append(" more lines)");
  LogLine(level, line);
}

void LimitedLog::Write(const Status& fault) { Write(LogLevel::kError, TextOf(fault)); }

}  // namespace viewfix
