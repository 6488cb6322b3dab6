// SPDX-License-Identifier: BSD-3-Clause
// viewfix-tools: all commands, started by viewfix for those that it does not do itself.
#include <CLI/CLI.hpp>

#include "firmware_tools/cli/commands.h"
#include "firmware_tools/cli/run_commands.h"

int main(int argc, char** argv) {
  CLI::App app(
      "viewfix turns photographs of a building into a model that tells a camera where it is.\n"
      "Example:\n"
      "  viewfix simulate --out museum\n"
      "  viewfix train museum --out museum.vfx\n"
      "  viewfix eval museum --model museum.vfx");
  app.set_version_flag("--version", VIEWFIX_VERSION);
  viewfix::AddSimulate(app);
  viewfix::AddCheck(app);
  viewfix::AddTrain(app);
  viewfix::AddEval(app);
  viewfix::AddExperiment(app);
  viewfix::AddInspect(app);
  viewfix::AddExport(app);
  viewfix::AddMap(app);
  viewfix::AddCalibrate(app);
  viewfix::AddBoardCommands(app);
  return viewfix::RunCommands(app, argc, argv);
}
