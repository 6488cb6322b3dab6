// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <string>

#include "firmware_tools/cli/commands.h"
#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/mapping/model_export.h"

namespace viewfix {
namespace {

struct ExportFlags {
  std::string model;
  std::string out;
  std::string format;
};

ExportFormat FormatOf(const std::string& name) {
  if (name == "colmap") return ExportFormat::kColmap;
  return name == "ply" ? ExportFormat::kPly : ExportFormat::kTum;
}

void RunExport(const ExportFlags& flags) {
  const auto bytes = ReadModelFile(flags.model);
  const Result<ModelView> model = ModelView::Open(bytes);
  if (!model.ok()) throw ToolError(flags.model + ": " + model.status().text());
  if (!model->has_landmarks()) {
    throw ToolError(flags.model +
                    ": the model has no landmarks: train it with poses, or with --map colmap");
  }
  for (const auto& path : ExportModel(*model, FormatOf(flags.format), flags.out)) {
    std::printf("%s\n", path.c_str());
  }
}

}  // namespace

void AddExport(CLI::App& app) {
  auto flags = std::make_shared<ExportFlags>();
  CLI::App* command = app.add_subcommand(
      "export",
      "a model's map in a form that other programs open\n"
      "Example: viewfix export museum.vfx --format colmap --out museum-map\n"
      "A model of several maps gives museum-map/0, museum-map/1, ...; ply and tum give map-0.ply,\n"
      "map-1.ply, ... for --out map.ply. ply writes the cameras to map-cameras.ply beside it.");
  command->add_option("model", flags->model, "the model file")->required();
  command
      ->add_option("--format", flags->format,
                   "colmap (a folder), ply (points) or tum (the keyframes' poses)")
      ->required()
      ->check(CLI::IsMember({"colmap", "ply", "tum"}));
  command->add_option("--out", flags->out, "folder (colmap) or file to write")->required();
  command->callback([flags] { RunExport(*flags); });
}

}  // namespace viewfix
