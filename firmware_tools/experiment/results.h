// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "firmware_tools/evaluation/metrics.h"
#include "firmware_tools/experiment/experiment.h"

namespace viewfix {

// Mean over splits of the share right, with its 95 % bootstrap interval: splits are drawn with
// replacement, then the images in each (2000 times, seeded), since images of one split share a
// training and splits share images.
struct Share {
  double mean = 0;
  Interval ci95;
};

//   right [splits][images]; a split without images does not count
Share BootstrapShare(const std::vector<std::vector<bool>>& right);

// Every figure of an experiment, as `experiment --json` writes it (interfaces.md).
nlohmann::ordered_json ExperimentAsJson(const ImageSet& set, const ExperimentResult& result,
                                        const ExperimentOptions& options);

// The same as tables to read, the paper's own figures beside them.
std::string ExperimentAsText(const nlohmann::ordered_json& figures);

}  // namespace viewfix
