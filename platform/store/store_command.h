// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace viewfix {

// `viewfixd store ...`: argv[0] is "store". Returns the exit code.
int RunStoreCommand(int argc, char** argv);

}  // namespace viewfix
