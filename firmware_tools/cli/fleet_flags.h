// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "firmware_tools/flash/fleet.h"

namespace CLI {
class App;
}

namespace viewfix {

// Which boards `flash` and `provision` go to, how, and what is said of it.
struct FleetFlags {
  std::vector<std::string> to;
  std::string boards;
  LinkOptions link;
  FleetOptions fleet;
  bool json = false;
};

void AddFleetFlags(CLI::App& command, FleetFlags& flags);

// Throws CLI::ValidationError if no board is named.
std::vector<BoardAddress> BoardsOf(const FleetFlags& flags);

// Runs the work and prints a line a board and a summary, or JSON lines. Throws ToolError if a board
// is left without.
void RunOnBoards(const FleetFlags& flags, const std::vector<BoardAddress>& boards,
                 const std::function<std::string(const BoardAddress&)>& work);

// One JSON line on stdout, whole also where boards are worked on side by side.
void PrintJsonEvent(const std::string& line);

}  // namespace viewfix
