// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "firmware_tools/dataset/image_set.h"
#include "models/model_view.h"

namespace viewfix {

// What a report is of, as its heading says it.
struct ReportTitle {
  std::string set;
  std::string model;
  std::string split;
  std::string map;  // the map's page, as a relative address; empty: none
};

// An evaluation as one HTML page that needs no other file: the figures of `eval --json` as tables
// and plots, and the worst failures as pictures, read from the set. Pictures that cannot be read
// are left out.
std::string EvalReportHtml(const ReportTitle& title, const ImageSet& set, const ModelView& model,
                           const nlohmann::ordered_json& figures);

}  // namespace viewfix
