// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/report/eval_report.h"

#include <nlohmann/json.hpp>

#include "firmware_tools/report/failure_pictures.h"
#include "firmware_tools/report/page.h"
#include "firmware_tools/training/model_localizer.h"

namespace viewfix {
namespace {

using Json = nlohmann::ordered_json;

// The floor plan lies in site coordinates.
Json FloorPlanUnder(const Json& figures, const ModelView& model) {
  return figures["positions_in"] == "site" ? FloorPlanForPage(model) : Json();
}

}  // namespace

std::string EvalReportHtml(const ReportTitle& title, const ImageSet& set, const ModelView& model,
                           const Json& figures) {
  const auto hash = model.short_hash();
  const Json data = {
      {"title",
       {{"set", title.set},
        {"model", title.model},
        {"split", title.split},
        {"map", title.map},
        {"hash", std::string(hash.begin(), hash.end())}}},
      {"floor_plan", FloorPlanUnder(figures, model)},
      {"failures", FailurePictures(set, FeatureOptionsOf(model.features()), figures)},
      {"figures", figures}};
  return PlotPage(EvalReportScript(), data);
}

}  // namespace viewfix
