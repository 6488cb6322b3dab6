// SPDX-License-Identifier: BSD-3-Clause
#include <cstdio>
#include <string>
#include <string_view>

#include "platform/camera/libcamera/libcamera_camera.h"
#include "platform/camera/v4l2/v4l2_camera.h"
#include "platform/daemon/daemon.h"
#include "platform/daemon/options.h"
#include "platform/store/store_command.h"

namespace viewfix {
namespace {

int WrongUsage(const std::string& what) {
  std::fprintf(stderr, "viewfixd: %s (see viewfixd --help)\n", what.c_str());
  return 2;
}

int RunOrCheck(const CommandLine& line) {
  DaemonOptions options;
  if (const std::string fault = LoadOptions(line, options); !fault.empty()) {
    return WrongUsage(fault);
  }
  if (line.action == CommandLine::Action::kRun) return RunDaemon(line, options);
  std::puts("viewfixd: the configuration is good");
  return 0;
}

int Cameras(int argc, char** argv) {
  if (argc > 1) return WrongUsage(std::string("unexpected argument ") + argv[1]);
  const std::string text = DescribeCameras(RealV4l2System()) + DescribeLibcameraCameras();
  std::fputs(text.empty() ? "No camera found.\n" : text.c_str(), stdout);
  return 0;
}

struct Subcommand {
  std::string_view name;
  int (*run)(int argc, char** argv);  // argv[0] is the name
};

constexpr Subcommand kSubcommands[] = {{"cameras", Cameras}, {"store", RunStoreCommand}};

// The daemon itself: what is not a subcommand.
int RunAsDaemon(int argc, char** argv) {
  const CommandLine line = ParseCommandLine(argc, argv);
  switch (line.action) {
    case CommandLine::Action::kHelp:
      std::fputs(DaemonHelp(), stdout);
      return 0;
    case CommandLine::Action::kVersion:
      std::puts("viewfixd " VIEWFIX_VERSION);
      return 0;
    case CommandLine::Action::kWrongUsage:
      return WrongUsage(line.error);
    default:
      return RunOrCheck(line);
  }
}

int Main(int argc, char** argv) {
  for (const Subcommand& command : kSubcommands) {
    if (argc > 1 && command.name == argv[1]) return command.run(argc - 1, argv + 1);
  }
  return RunAsDaemon(argc, argv);
}

}  // namespace
}  // namespace viewfix

int main(int argc, char** argv) { return viewfix::Main(argc, argv); }
