// SPDX-License-Identifier: BSD-3-Clause
#include "tests/testing/allocation_counter.h"

#include <gtest/gtest.h>

#include <cstdlib>

namespace viewfix {
namespace {

// Else every "allocates nothing" of this program would be empty words.
TEST(AllocationCounter, Counts) {
  if (!CountsAllocations()) GTEST_SKIP() << "AddressSanitizer owns malloc";
  const int before = AllocationsSoFar();
  void* volatile memory = std::malloc(100);
  std::free(memory);
  int* volatile number = new int;
  delete number;
  EXPECT_GE(AllocationsSoFar(), before + 2);
}

}  // namespace
}  // namespace viewfix
