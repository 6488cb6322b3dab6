// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "firmware_tools/common/parallel.h"

namespace viewfix {

// From now on the first Ctrl-C (or SIGTERM) makes the next report of progress throw
// ToolError("interrupted"), so that a command ends in order; a second one ends it at once.
void CatchInterrupts();

// Shows a stage of long work on stderr: a bar with the time left on a terminal, else a line
// when it begins and when it ends. Interrupts are noticed here.
Progress ShowProgress(const std::string& stage);

// Fails early where a result could not be written at the end: throws ToolError if the
// folder that `file` is to stand in does not exist or takes no new files.
void CheckCanWrite(const std::string& file);

}  // namespace viewfix
