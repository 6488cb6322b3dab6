// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/cli/run_commands.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>

#include "firmware_tools/cli/commands.h"
#include "firmware_tools/cli/terminal.h"

namespace viewfix {

void AddBoardCommands(CLI::App& app) {
  AddKeygen(app);
  AddSign(app);
  AddVerify(app);
  AddFlash(app);
  AddProvision(app);
}

int RunCommands(CLI::App& app, int argc, char** argv) {
  app.require_subcommand(1);
  CatchInterrupts();
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

}  // namespace viewfix
