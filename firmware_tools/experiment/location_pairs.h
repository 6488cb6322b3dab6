// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "firmware_tools/training/labels.h"

namespace viewfix {

// The pairs of a location, ascending: the tasks of its model.
inline std::vector<int> PairsOf(const Labels& labels, int location) {
  std::vector<int> pairs;
  for (int p = 0; p < labels.num_pairs(); ++p) {
    if (labels.pair_location[p] == location) pairs.push_back(p);
  }
  return pairs;
}

}  // namespace viewfix
