// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace viewfix {

// An experiment as one HTML page that needs no other file: the figures of `experiment --json`.
std::string ExperimentReportHtml(const std::string& set, const nlohmann::ordered_json& figures);

}  // namespace viewfix
