// SPDX-License-Identifier: BSD-3-Clause
// viewfix: what is about boards is done here; all else is of viewfix-tools, which lies beside it.
// That one's libraries (OpenCV and 250 more) take longer to load than a model takes to a board.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <string>

#include "firmware_tools/cli/commands.h"
#include "firmware_tools/cli/run_commands.h"

namespace viewfix {
namespace {

// Does not return where it succeeds.
int BecomeTools(char** argv) {
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  if (error) {
    std::fprintf(stderr, "viewfix: cannot find viewfix-tools: /proc/self/exe: %s\n",
                 error.message().c_str());
    return 1;
  }
  const std::string tools = self.parent_path() / "viewfix-tools";
  ::execv(tools.c_str(), argv);
  std::fprintf(stderr, "viewfix: cannot run %s: %s\n", tools.c_str(), std::strerror(errno));
  return 1;
}

}  // namespace
}  // namespace viewfix

int main(int argc, char** argv) {
  CLI::App app;
  viewfix::AddBoardCommands(app);
  const std::string command = argc < 2 ? "" : argv[1];
  const auto is_it = [&](const CLI::App* known) { return known->get_name() == command; };
  if (app.get_subcommands(is_it).empty()) return viewfix::BecomeTools(argv);
  return viewfix::RunCommands(app, argc, argv);
}
