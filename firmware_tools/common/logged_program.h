// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace viewfix {

// Runs a program to its end, what it prints going to the end of `log`. `poll` is called a few
// times a second with what was added to the log since the last call; what it throws ends the
// program and is thrown on, so that no child outlives an interrupted command.
//   command   the program (found in PATH if it has no slash) and its arguments
// Throws ToolError: "PROGRAM: not found ..." if it is not installed; "PROGRAM failed (exit code
// 1); the end of LOG: ..." with the log's last lines if it fails or is killed.
void RunLogged(const std::vector<std::string>& command, const std::filesystem::path& log,
               const std::function<void(const std::string& added)>& poll = {});

}  // namespace viewfix
