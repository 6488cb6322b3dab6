// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace viewfix {

// One division of the samples: true where a sample is for testing.
using Split = std::vector<bool>;

struct SplitOptions {
  int count = 10;  // >= 1
  // Test images of a group: a share of it, at least one, where the set's own split names none.
  // 0.15: the paper's 3 of 20.
  double test_share = 0.15;
  // Test images of a group that follow one another, not any: of a walk, images drawn one by one
  // would each leave a near copy in training.
  bool as_runs = false;
  std::uint64_t seed = 1;
};

// Divisions of samples into training and test, each group (a location and view; or a location)
// for itself. The first is the set's own, `own_test`, where that has both kinds; each later one
// draws as many test samples of a group as the own split has, and leaves a group two for training.
//   group_of [samples] 0..; in the set's order    own_test [samples]
std::vector<Split> DrawSplits(std::span<const int> group_of, const Split& own_test,
                              const SplitOptions& options);

}  // namespace viewfix
