// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/report/experiment_report.h"

#include <nlohmann/json.hpp>

#include "firmware_tools/report/page.h"

namespace viewfix {

std::string ExperimentReportHtml(const std::string& set, const nlohmann::ordered_json& figures) {
  return PlotPage(ExperimentReportScript(), {{"title", {{"set", set}}}, {"figures", figures}});
}

}  // namespace viewfix
