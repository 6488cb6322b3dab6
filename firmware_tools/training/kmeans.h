// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "firmware_tools/common/parallel.h"

namespace viewfix {

struct KMeansOptions {
  int num_words = 500;      // 2..65535
  int max_iterations = 25;  // >= 1; it also ends when the inertia stops falling
  std::uint64_t seed = 1;
  int jobs = 0;  // threads, 0: one for each core; the result does not depend on it
};

struct KMeansResult {
  std::vector<std::int8_t> words;  // [num_words, dim] cluster centres
  // Sum of squared distances to the nearest word over the descriptors used, when each
  // iteration starts. Exact, and never rises.
  std::vector<std::int64_t> inertia;
};

// Cluster centres of descriptors: Lloyd's k-means on integers (the mean rounded to whole
// numbers is the best whole centre, so rounding costs no convergence), seeded by greedy k-means++
// (Arthur, Vassilvitskii, SODA 2007) on a sample. At most max(500000, 64 * num_words)
// descriptors are used, drawn evenly: more move the centres little and cost time. A word that
// is nearest to nothing moves to the descriptor farthest from its word.
//   descriptors [n, dim] signed bytes, one after another; 1 <= dim <= 128
// `progress` counts iterations. Throws ToolError where n < num_words or an option is out of
// range.
KMeansResult ClusterDescriptors(std::span<const std::int8_t> descriptors, int dim,
                                const KMeansOptions& options, const Progress& progress = {});

}  // namespace viewfix
