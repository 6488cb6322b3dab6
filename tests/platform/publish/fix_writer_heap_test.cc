// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "platform/publish/fix_writer.h"
#include "tests/testing/tiny_model.h"

namespace {
std::atomic<int> g_allocations = 0;
}  // namespace

// Not inlined: g++ would take free() for the wrong counterpart of new.
[[gnu::noinline]] void* operator new(std::size_t size) {
  ++g_allocations;
  if (void* memory = std::malloc(size == 0 ? 1 : size)) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  ++g_allocations;
  return std::malloc(size == 0 ? 1 : size);
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace viewfix {
namespace {

TEST(FixWriterHeapTest, WritingAllocatesNothing) {
  const std::vector<std::uint8_t> bytes = TinyModel();
  const ModelView model = *ModelView::Open(bytes);
  FixWriter writer(model);
  const Fix fix = {.localized = true,
                   .reasons = kAmbiguous,
                   .location_idx = 0,
                   .pair_idx = 1,
                   .keyframe_idx = 2,
                   .confidence = 0.1F,
                   .has_pose = true,
                   .map_idx = 0,
                   .score = 1e-9F,
                   .margin = -3e20F,
                   .num_rivals = 1,
                   .rivals = {1},
                   .ms = {}};
  const int before = g_allocations;
  EXPECT_GT(before, 0);  // the counter counts
  for (std::uint64_t i = 0; i < 100; ++i) {
    EXPECT_FALSE(writer.Write({i, 1, 1'777'863'721'005'000'000, 2}, fix).empty());
  }
  EXPECT_EQ(g_allocations, before);
}

}  // namespace
}  // namespace viewfix
