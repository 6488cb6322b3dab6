// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "platform/daemon/options.h"

namespace viewfix {

// Runs until the source ends or a signal says so. Returns the program's exit code.
int RunDaemon(const CommandLine& command_line, const DaemonOptions& options);

}  // namespace viewfix
