// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace viewfix {

// Calls of malloc, and of what is made of it, by the program so far. A program that links
// viewfix_allocation_counter has its malloc replaced.
int AllocationsSoFar();

// False under AddressSanitizer, which has a malloc of its own: nothing is counted then.
bool CountsAllocations();

}  // namespace viewfix
