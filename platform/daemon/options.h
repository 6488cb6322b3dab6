// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace viewfix {

// The command line of viewfixd.
struct DaemonOptions {
  enum class Action { kRun, kHelp, kVersion, kWrongUsage };

  Action action = Action::kRun;
  std::string error;  // kWrongUsage: what is wrong
  std::string model_path;
  std::string store_folder;  // in place of model_path
  std::string trust_folder = "/etc/viewfix/trust";
  std::string replay_folder;
  std::string calibration_path;  // empty: the model's camera
  bool filter = true;            // agreement over frames (engine/fix_filter.h)
  int window = 0;                // frames adjusted together: 0, 3..8
  int rotate_deg = 0;            // clockwise, before localizing: 0, 90, 180, 270
};

// Reads the arguments of main(); call once a process (getopt keeps its place).
DaemonOptions ParseDaemonOptions(int argc, char** argv);

// The text of --help.
const char* DaemonHelp();

}  // namespace viewfix
