// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "tests/testing/run_program.h"

namespace viewfix {

// The viewfix command with these arguments.
inline ProgramRun Viewfix(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), VIEWFIX);
  return RunProgram(arguments);
}

// The line that says why, behind the progress and the warnings.
inline std::string LastLine(const ProgramRun& run) {
  const auto lines = Lines(run.err);
  return lines.empty() ? "" : lines.back();
}

}  // namespace viewfix
