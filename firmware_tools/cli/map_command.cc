// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "firmware_tools/cli/commands.h"
#include "firmware_tools/cli/terminal.h"
#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/dataset/tool_file.h"
#include "firmware_tools/report/map_page.h"

namespace viewfix {
namespace {

struct MapFlags {
  std::string model;
  std::string out;
  std::string fixes;
};

void RunMap(const MapFlags& flags) {
  CheckMapLibraries("map");
  CheckCanWrite(flags.out);
  const auto bytes = ReadModelFile(flags.model);
  const Result<ModelView> model = ModelView::Open(bytes);
  if (!model.ok()) throw ToolError(flags.model + ": " + model.status().text());
  CheckHasMap(flags.model, *model);
  const auto walk = flags.fixes.empty() ? nlohmann::ordered_json::array() : ReadWalk(flags.fixes);
  WriteTextFile(flags.out, MapHtml(flags.model, *model, walk));
}

}  // namespace

void AddMap(CLI::App& app) {
  auto flags = std::make_shared<MapFlags>();
  CLI::App* command =
      app.add_subcommand("map",
                         "a model's map in 3D, as one HTML page that works offline\n"
                         "Example: viewfix map museum.vfx --out map.html");
  command->add_option("model", flags->model, "the model file")->required();
  command->add_option("--out", flags->out, "the page to write")->required();
  command->add_option("--fixes", flags->fixes,
                      "what viewfixd wrote (JSON lines): its poses, replayed as a moving camera");
  command->callback([flags] { RunMap(*flags); });
}

}  // namespace viewfix
