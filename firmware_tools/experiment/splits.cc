// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/experiment/splits.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace viewfix {
namespace {

struct Group {
  std::vector<int> samples;
  int test = 0;  // how many are for testing
};

bool HasBoth(const Split& split) {
  return std::count(split.begin(), split.end(), true) > 0 &&
         std::count(split.begin(), split.end(), false) > 0;
}

std::vector<Group> MakeGroups(std::span<const int> group_of, const Split& own, bool own_counts,
                              double share) {
  std::vector<Group> groups;
  for (int s = 0; s < static_cast<int>(group_of.size()); ++s) {
    if (group_of[s] >= static_cast<int>(groups.size())) groups.resize(group_of[s] + 1);
    groups[group_of[s]].samples.push_back(s);
    groups[group_of[s]].test += own[s] ? 1 : 0;
  }
  for (Group& group : groups) {
    const int n = static_cast<int>(group.samples.size());
    if (!own_counts) group.test = std::max(1, static_cast<int>(std::lround(share * n)));
    group.test = std::clamp(group.test, 0, std::max(0, n - 2));
  }
  return groups;
}

void DrawAny(const Group& group, std::mt19937_64& random, Split& split) {
  std::vector<int> rest = group.samples;
  for (int drawn = 0; drawn < group.test; ++drawn) {
    std::swap(rest[drawn], rest[drawn + random() % (rest.size() - drawn)]);
    split[rest[drawn]] = true;
  }
}

void DrawRun(const Group& group, std::mt19937_64& random, Split& split) {
  const std::size_t begin = random() % (group.samples.size() - group.test + 1);
  for (int i = 0; i < group.test; ++i) split[group.samples[begin + i]] = true;
}

}  // namespace

std::vector<Split> DrawSplits(std::span<const int> group_of, const Split& own_test,
                              const SplitOptions& options) {
  const bool has_own = HasBoth(own_test);
  const auto groups = MakeGroups(group_of, own_test, has_own, options.test_share);
  std::vector<Split> splits;
  if (has_own) splits.push_back(own_test);
  for (int i = static_cast<int>(splits.size()); i < options.count; ++i) {
    std::mt19937_64 random(options.seed * 1000003 + i);
    Split split(group_of.size(), false);
    for (const Group& group : groups) {
      if (group.test == 0) continue;
      if (options.as_runs) {
        DrawRun(group, random, split);
      } else {
        DrawAny(group, random, split);
      }
    }
    splits.push_back(std::move(split));
  }
  return splits;
}

}  // namespace viewfix
