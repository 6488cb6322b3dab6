// SPDX-License-Identifier: BSD-3-Clause
#include "tests/testing/allocation_counter.h"

#include <cstddef>

namespace {
int allocations = 0;
}

#ifndef __SANITIZE_ADDRESS__
constexpr bool kCounts = true;
// glibc's own, under the name that stays when malloc is replaced.
extern "C" void* __libc_malloc(std::size_t size);
extern "C" void* malloc(std::size_t size) {
  ++allocations;
  return __libc_malloc(size);
}
#else
constexpr bool kCounts = false;
#endif

namespace viewfix {

int AllocationsSoFar() { return allocations; }
bool CountsAllocations() { return kCounts; }

}  // namespace viewfix
