// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace viewfix {

struct ProgramRun {
  int exit_code = -1;  // -1: ended by a signal, or could not be started
  std::string out;
  std::string err;
};

// Runs a program to its end. command[0] is its path.
ProgramRun RunProgram(const std::vector<std::string>& command);

// The lines of a text, without their ends.
std::vector<std::string> Lines(const std::string& text);

}  // namespace viewfix
