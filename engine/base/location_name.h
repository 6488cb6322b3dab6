// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <string_view>

// Names of locations are paths: "floor10/lobby" has two levels, the first of them "floor10".
namespace viewfix {

inline int LevelsOf(std::string_view name) {
  return 1 + static_cast<int>(std::count(name.begin(), name.end(), '/'));
}

// The first `level` parts; the whole name where it has no more.
inline std::string_view UpToLevel(std::string_view name, int level) {
  std::size_t end = 0;
  for (int part = 0; part < level && end != std::string_view::npos; ++part) {
    end = name.find('/', part == 0 ? 0 : end + 1);
  }
  return name.substr(0, end);
}

// How many parts two names begin with in common; all of them if they are the same.
inline int CommonLevels(std::string_view a, std::string_view b) {
  const int levels = std::min(LevelsOf(a), LevelsOf(b));
  int common = 0;
  while (common < levels && UpToLevel(a, common + 1) == UpToLevel(b, common + 1)) ++common;
  return common;
}

}  // namespace viewfix
