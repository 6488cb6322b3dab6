// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace viewfix {

// Asks on the terminal, without showing what is typed; where stdin is none, reads its next line.
// Throws ToolError where there is no line.
std::string AskPassword(const std::string& prompt);

}  // namespace viewfix
