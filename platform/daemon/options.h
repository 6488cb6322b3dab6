// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "engine/base/status.h"
#include "platform/camera/camera_settings.h"
#include "platform/publish/publish_settings.h"

namespace viewfix {

// All that viewfixd is told.
struct DaemonOptions {
  std::string model_path;
  std::string store_folder;  // in place of model_path
  std::string trust_folder = "/etc/viewfix/trust";
  CameraSettings camera;
  PublishSettings publish;
  std::string calibration_path;  // empty: the model's camera
  bool filter = true;            // agreement over frames (engine/fix_filter.h)
  int window = 0;                // frames adjusted together: 0, 3..8
  int rotate_deg = 0;            // clockwise, before localizing: 0, 90, 180, 270
  double max_fps = 0;            // frames localized a second; 0: as many as there is time for
  double idle_fps = 0;           // the same while the scene is still; 0: as max_fps

  friend bool operator==(const DaemonOptions&, const DaemonOptions&) = default;
};

// One setting as text: {"max-fps", "5"}.
using SettingText = std::pair<std::string, std::string>;

// The command line of viewfixd, not yet joined with its configuration file.
struct CommandLine {
  enum class Action { kRun, kCheckConfig, kHelp, kVersion, kWrongUsage };

  Action action = Action::kRun;
  std::string error;        // kWrongUsage: what is wrong
  std::string config_path;  // empty: none
  std::vector<SettingText> settings;
};

// Reads the arguments of main(); call once a process (getopt keeps its place).
CommandLine ParseCommandLine(int argc, char** argv);

// The configuration file, if one is named, and over it the flags. Empty: `options` is whole and
// consistent; else one line that says what is wrong. Call it again when the file has changed.
std::string LoadOptions(const CommandLine& command_line, DaemonOptions& options);

// Takes one setting. Empty: taken; else what is wrong with the value. Numbers, words and lists
// with commas, as on the command line.
std::string TakeSetting(const SettingText& setting, DaemonOptions& options);

// Whether there is a setting of this name ("max-fps").
bool IsSetting(const std::string& name);

// The text of --help.
const char* DaemonHelp();

}  // namespace viewfix
