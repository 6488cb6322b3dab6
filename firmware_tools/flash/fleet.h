// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "firmware_tools/flash/link.h"

namespace viewfix {

// The addresses of a file, one a line, '#' begins a comment. Throws ToolError naming file and line.
std::vector<BoardAddress> ReadBoards(const std::string& path);

struct FleetOptions {
  int jobs = 8;     // boards at a time
  int retries = 3;  // of a board whose link broke
  double pause_s = 1;
};

struct BoardReport {
  BoardAddress address;
  bool done = false;
  int tries = 0;
  std::string text;  // what was done, or why not
};

// Does `work` on every board, again where the link broke, which `work` says by LinkBroke; any other
// exception is final for its board. `report` hears of each end, one at a time.
std::vector<BoardReport> ForEachBoard(const std::vector<BoardAddress>& boards,
                                      const FleetOptions& options,
                                      const std::function<std::string(const BoardAddress&)>& work,
                                      const std::function<void(const BoardReport&)>& report);

}  // namespace viewfix
