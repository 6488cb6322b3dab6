// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>

#include "firmware_tools/cli/commands.h"
#include "firmware_tools/cli/terminal.h"

int main(int argc, char** argv) {
  CLI::App app(
      "viewfix turns photographs of a building into a model that tells a camera where it is.\n"
      "Example:\n"
      "  viewfix simulate --out museum\n"
      "  viewfix train museum --out museum.vfx\n"
      "  viewfix eval museum --model museum.vfx");
  app.require_subcommand(1);
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
  viewfix::AddKeygen(app);
  viewfix::AddSign(app);
  viewfix::AddVerify(app);
  viewfix::AddFlash(app);
  viewfix::AddProvision(app);
  viewfix::CatchInterrupts();
  try {
    app.parse(argc, argv);
    return 0;
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "viewfix: %s\n", error.what());
    return 1;
  }
}
