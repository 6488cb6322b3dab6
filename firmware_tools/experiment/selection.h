// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "firmware_tools/common/parallel.h"
#include "firmware_tools/experiment/method.h"

namespace viewfix {

// What a method's parameters came to on held-out blocks.
struct Selection {
  std::vector<double> values;  // of Method::parameters()
  // Share of held-out samples with the right location, plus, where the method tells views and
  // these mean the same everywhere, that with the right view.
  double merit = 0;
};

// Chooses a method's parameters the way `viewfix train` chooses C, the negatives and beta: one
// after another, each value measured on the same blocks of neighbouring images that are held out
// in turn (HeldOutBlocks); of equals the first tried stays.
//   data.used   all the samples that may be trained on
Selection SelectParameters(const Method& method, const TrainingData& data, int folds, int jobs,
                           const Progress& progress = {});

}  // namespace viewfix
