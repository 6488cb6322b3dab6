// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "models/model_view.h"

namespace viewfix {

// The files that pages are made of. Libraries are empty where the build did not find them.
std::string_view ChartLibrary();
std::string_view PageStyle();
std::string_view ThreeCoreLibrary();
std::string_view ThreeLibrary();
std::string_view OrbitControlsLibrary();
std::string_view PlotPageFrame();
std::string_view PlotScript();
std::string_view EvalReportScript();
std::string_view ExperimentReportScript();
std::string_view MapPage();

// Throws ToolError naming what is missing, and what to do, if a library of `what` is empty.
void CheckLibrary(const std::string& what, std::string_view library, const std::string& name);

// `page` with each mark replaced by its text, in which no marks are looked for.
struct PagePart {
  std::string_view mark;
  std::string_view text;
};
std::string FillPage(std::string_view page, std::span<const PagePart> parts);

// JSON as it may stand in a <script> element, whatever its strings hold.
std::string ScriptJson(const nlohmann::ordered_json& json);

// A page with plots: what `script`, which PlotScript() precedes, makes of its data.
std::string PlotPage(std::string_view script, const nlohmann::ordered_json& data);

// A path as a relative address: "./" and what a browser takes for itself as %XX.
std::string UrlPath(std::string_view path);

// A PNG or JPEG file as a data URL.
std::string PictureUrl(std::span<const std::uint8_t> file);

// A model's floor plan, its picture as a data URL; null: it has none.
nlohmann::ordered_json FloorPlanForPage(const ModelView& model);

}  // namespace viewfix
