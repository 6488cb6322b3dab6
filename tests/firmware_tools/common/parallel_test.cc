// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/common/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <vector>

namespace viewfix {
namespace {

class Parallel : public ::testing::TestWithParam<int> {};  // jobs

TEST_P(Parallel, RunsEveryIndexOnce) {
  std::vector<std::atomic<int>> calls(1000);
  int reported = 0;
  ParallelFor(1000, GetParam(), [&](int i) { ++calls[i]; },
              [&](int done, int total) {
                EXPECT_EQ(done, ++reported);
                EXPECT_EQ(total, 1000);
              });
  for (const auto& count : calls) EXPECT_EQ(count, 1);
  EXPECT_EQ(reported, 1000);
}

TEST_P(Parallel, WorkersAreInRange) {
  ParallelForWorkers(100, GetParam(), [&](int, int worker) {
    EXPECT_GE(worker, 0);
    EXPECT_LT(worker, Workers(GetParam()));
  });
}

TEST_P(Parallel, AnExceptionEndsTheLoop) {
  std::atomic<int> calls = 0;
  const auto body = [&](int i) {
    ++calls;
    if (i == 3) throw std::runtime_error("three");
  };
  EXPECT_THROW(ParallelFor(1000000, GetParam(), body), std::runtime_error);
  EXPECT_LT(calls, 1000000);
}

TEST_P(Parallel, WhatProgressThrowsEndsTheLoop) {
  std::atomic<int> calls = 0;
  EXPECT_THROW(ParallelFor(1000000, GetParam(), [&](int) { ++calls; },
                           [](int, int) { throw std::runtime_error("stop"); }),
               std::runtime_error);
  EXPECT_LT(calls, 1000000);
}

TEST_P(Parallel, NothingToDo) {
  ParallelFor(0, GetParam(), [](int) { FAIL(); });
}

INSTANTIATE_TEST_SUITE_P(Jobs, Parallel, ::testing::Values(0, 1, 4));

}  // namespace
}  // namespace viewfix
