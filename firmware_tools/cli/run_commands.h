// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace CLI {
class App;
}

namespace viewfix {

// Those that need a model file at most, no photographs: keygen, sign, verify, flash, provision.
void AddBoardCommands(CLI::App& app);

// Parses the line, which runs its command, and says what went wrong; the exit code: 0 done,
// 1 failed, 2 wrong usage.
int RunCommands(CLI::App& app, int argc, char** argv);

}  // namespace viewfix
