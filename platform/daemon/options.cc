// SPDX-License-Identifier: BSD-3-Clause
#include "platform/daemon/options.h"

#include <getopt.h>

#include <string_view>

namespace viewfix {
namespace {

constexpr std::string_view kReplay = "replay:";

enum Flag : int {
  kModel = 1,
  kStore,
  kTrust,
  kCamera,
  kPublish,
  kCalibration,
  kRotate,
  kWindow,
  kFilter,
  kHelp,
  kVersion
};

constexpr option kFlags[] = {
    {"model", required_argument, nullptr, kModel},
    {"store", required_argument, nullptr, kStore},
    {"trust", required_argument, nullptr, kTrust},
    {"camera", required_argument, nullptr, kCamera},
    {"publish", required_argument, nullptr, kPublish},
    {"calibration", required_argument, nullptr, kCalibration},
    {"rotate", required_argument, nullptr, kRotate},
    {"window", required_argument, nullptr, kWindow},
    {"filter", required_argument, nullptr, kFilter},
    {"help", no_argument, nullptr, kHelp},
    {"version", no_argument, nullptr, kVersion},
    {},
};

DaemonOptions WrongUsage(std::string error) {
  DaemonOptions options;
  options.action = DaemonOptions::Action::kWrongUsage;
  options.error = std::move(error);
  return options;
}

// -1: none of the four.
int RotationOf(std::string_view text) {
  if (text == "0") return 0;
  if (text == "90") return 90;
  if (text == "180") return 180;
  return text == "270" ? 270 : -1;
}

// -1: neither 0 nor 3..8.
int WindowOf(std::string_view text) {
  if (text.size() != 1 || (text[0] != '0' && (text[0] < '3' || text[0] > '8'))) return -1;
  return text[0] - '0';
}

// Empty: the value is taken; else what is wrong with it.
std::string Take(int flag, const std::string& value, DaemonOptions& options) {
  switch (flag) {
    case kModel:
      options.model_path = value;
      return {};
    case kStore:
      options.store_folder = value;
      return value.empty() ? "--store needs a folder" : "";
    case kTrust:
      options.trust_folder = value;
      return value.empty() ? "--trust needs a folder" : "";
    case kCamera:
      if (value.rfind(kReplay, 0) != 0 || value.size() == kReplay.size()) {
        return "--camera " + value + ": this build has replay:DIR only";
      }
      options.replay_folder = value.substr(kReplay.size());
      return {};
    case kPublish:
      return value == "stdout" ? "" : "--publish " + value + ": this build has stdout only";
    case kCalibration:
      options.calibration_path = value;
      return value.empty() ? "--calibration needs a file" : "";
    case kRotate:
      options.rotate_deg = RotationOf(value);
      return options.rotate_deg >= 0 ? "" : "--rotate " + value + ": not 0, 90, 180 or 270";
    case kWindow:
      options.window = WindowOf(value);
      return options.window >= 0 ? "" : "--window " + value + ": not 0 or 3 to 8";
    case kFilter:
      options.filter = value != "off";
      return value == "on" || value == "off" ? "" : "--filter " + value + ": not on or off";
    case kHelp:
      options.action = DaemonOptions::Action::kHelp;
      return {};
    default:
      options.action = DaemonOptions::Action::kVersion;
      return {};
  }
}

}  // namespace

DaemonOptions ParseDaemonOptions(int argc, char** argv) {
  DaemonOptions options;
  opterr = 0;
  int flag = 0;
  while ((flag = getopt_long(argc, argv, ":", kFlags, nullptr)) != -1) {
    const std::string given = argv[optind - 1];
    if (flag == ':') return WrongUsage(given + " needs a value");
    if (flag == '?') return WrongUsage("unknown option " + given);
    std::string error = Take(flag, optarg == nullptr ? "" : optarg, options);
    if (!error.empty()) return WrongUsage(std::move(error));
    if (options.action != DaemonOptions::Action::kRun) return options;
  }
  if (optind < argc) return WrongUsage(std::string("unexpected argument ") + argv[optind]);
  if (options.model_path.empty() && options.store_folder.empty()) {
    return WrongUsage("--model FILE is missing, or --store DIR");
  }
  if (!options.model_path.empty() && !options.store_folder.empty()) {
    return WrongUsage("--model and --store exclude each other");
  }
  if (options.replay_folder.empty()) return WrongUsage("--camera replay:DIR is missing");
  return options;
}

const char* DaemonHelp() {
  return R"(viewfixd: tells where a camera is, one JSON line a frame on stdout.

  viewfixd --model FILE | --store DIR --camera replay:DIR [--calibration FILE] [--publish stdout]
           [--rotate DEG] [--window N] [--filter on|off]

  --model FILE         the model that `viewfix train` made
  --store DIR          the folder of models that `viewfix flash` and `viewfixd store` fill: starts
                       from the current one, and goes over to the next while it runs
  --trust DIR          whose models are taken from it (default /etc/viewfix/trust); see
                       viewfixd store --help
  --camera replay:DIR  the *.jpg of a folder in name order, or, where the folder holds
                       images.csv, the files of its path column in row order
  --calibration FILE   of the camera, in OpenCV's or ROS's YAML, for frames as they are after
                       --rotate; default: the camera that the site was photographed with
  --publish stdout     where fixes go (the default)
  --rotate DEG         turn frames clockwise first: 0, 90, 180 or 270
  --window N           adjust the poses of the last N frames together, 3 to 8, for a camera that
                       moves steadily in a map in metres; 0: each frame alone (the default)
  --filter on|off      on (the default): frames that agree with those before them gain confidence,
                       those that contradict them lose it, and their answer where it becomes too
                       small; off: each frame is judged alone
  --help, --version    print and end

Exit codes: 0 done; 1 failed, with one line on stderr; 2 wrong usage.

Example: viewfixd --model site.vfx --camera replay:walk/ > fixes.jsonl
)";
}

}  // namespace viewfix
