// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/report/page.h"

#include <cctype>
#include <nlohmann/json.hpp>

#include "firmware_tools/common/base64.h"
#include "firmware_tools/dataset/image_set.h"

namespace viewfix {

void CheckLibrary(const std::string& what, std::string_view library, const std::string& name) {
  if (!library.empty()) return;
  throw ToolError(what + ": this viewfix was built without " + name +
                  ", which draws the page: run toolchains/fetch_web_libraries.sh (it needs npm and "
                  "a network), then build again");
}

std::string FillPage(std::string_view page, std::span<const PagePart> parts) {
  std::string filled;
  std::size_t from = 0;
  while (true) {
    // The first of all marks: what was filled in is not looked at again.
    std::size_t first = std::string_view::npos;
    const PagePart* next = nullptr;
    for (const PagePart& part : parts) {
      const std::size_t at = page.find(part.mark, from);
      if (at < first) {
        first = at;
        next = &part;
      }
    }
    filled += page.substr(from, first == std::string_view::npos ? first : first - from);
    if (next == nullptr) return filled;
    filled += next->text;
    from = first + next->mark.size();
  }
}

std::string ScriptJson(const nlohmann::ordered_json& json) {
  const std::string text =
      json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  std::string safe;
  safe.reserve(text.size());
  for (const char c : text) {
    // Only strings hold it; neither </script> nor <!-- can then end or open anything.
    if (c == '<') {
      safe += "\\u003c";
    } else {
      safe += c;
    }
  }
  return safe;
}

std::string PlotPage(std::string_view script, const nlohmann::ordered_json& data) {
  const std::string script_data = ScriptJson(data);
  const PagePart parts[] = {{"/*STYLE*/", PageStyle()},
                            {"/*LIBRARY*/", ChartLibrary()},
                            {"/*COMMON*/", PlotScript()},
                            {"/*SCRIPT*/", script},
                            {"/*DATA*/", script_data}};
  return FillPage(PlotPageFrame(), parts);
}

std::string UrlPath(std::string_view path) {
  constexpr std::string_view kPlain = "-._~/";
  constexpr std::string_view kHex = "0123456789ABCDEF";
  std::string url = "./";  // a colon further on then is no scheme
  for (const char c : path) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalnum(byte) != 0 || kPlain.find(c) != std::string_view::npos) {
      url += c;
    } else {
      url += {'%', kHex[byte >> 4], kHex[byte & 15]};
    }
  }
  return url;
}

std::string PictureUrl(std::span<const std::uint8_t> file) {
  constexpr std::uint8_t kFirstOfPng = 0x89;
  const bool png = !file.empty() && file[0] == kFirstOfPng;
  return (png ? "data:image/png;base64," : "data:image/jpeg;base64,") + Base64(file);
}

nlohmann::ordered_json FloorPlanForPage(const ModelView& model) {
  const ModelFloorPlan& plan = model.floor_plan();
  if (!model.has_floor_plan()) return nullptr;
  return {
      {"picture", PictureUrl(plan.picture)},
      {"width", plan.width},
      {"height", plan.height},
      {"site_from_pixel", std::vector(plan.site_from_pixel.begin(), plan.site_from_pixel.end())}};
}

}  // namespace viewfix
