// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "platform/daemon/options.h"

namespace viewfix {

inline constexpr std::size_t kMaxConfigBytes = std::size_t{1} << 20;

// A setting and the line of the file that it stands in.
struct ConfigEntry {
  SettingText setting;
  unsigned line = 0;
};

// The settings of a TOML text, in its order: keys are the flags' names with _ for -, values
// strings, numbers, true or false (on and off), lists of strings, and the table `controls`. Empty:
// read; else "LINE: what is wrong". No key is judged here.
std::string ParseConfig(std::string_view toml, std::vector<ConfigEntry>& entries);

// The same from a file, applied to `options`. Empty, or "FILE:LINE: what is wrong".
std::string ApplyConfigFile(const std::string& path, DaemonOptions& options);

}  // namespace viewfix
