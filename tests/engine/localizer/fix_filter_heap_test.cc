// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "engine/fix_filter.h"
#include "tests/testing/allocation_counter.h"
#include "tests/testing/tiny_model.h"

namespace viewfix {
namespace {

TEST(FixFilterHeap, ApplyAllocatesNothing) {
  const auto file = TinyModel();
  const ModelView model = *ModelView::Open(file);
  FixFilter filter(model);
  const int before = AllocationsSoFar();
  for (std::uint64_t i = 0; i < 20; ++i) {
    Fix fix;
    fix.localized = true;
    fix.location_idx = i % 3 == 0 ? 1 : 0;
    fix.confidence = 0.6F;
    filter.Apply(i, fix);
  }
  EXPECT_EQ(AllocationsSoFar(), before);
}

}  // namespace
}  // namespace viewfix
