// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "firmware_tools/experiment/method.h"

namespace viewfix {

// The location and view of the training image whose histogram is nearest (Euclidean), by
// exhaustive search; the first of equals. No parameters.
class NearestNeighbour : public Method {
 public:
  std::string name() const override { return "nearest_neighbour"; }
  bool tells_views() const override { return true; }
  std::vector<Parameter> parameters() const override { return {}; }
  std::unique_ptr<Predictor> Train(const TrainingData& data,
                                   std::span<const double> values) const override;
};

}  // namespace viewfix
