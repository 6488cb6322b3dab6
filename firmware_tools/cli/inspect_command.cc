// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "firmware_tools/cli/commands.h"
#include "firmware_tools/dataset/image_set.h"
#include "models/model_view.h"
#include "platform/file.h"

namespace viewfix {
namespace {

using Json = nlohmann::ordered_json;

struct InspectFlags {
  std::string model;
  bool json = false;
};

Json Sections(const ModelView& model) {
  const ModelKeyframes& k = model.keyframes();
  return {{"vocabulary", model.vocabulary().words.size_bytes()},
          {"weights", model.scoring().weights.size_bytes()},
          {"keyframe_histograms",
           k.word_begin.size_bytes() + k.words.size_bytes() + k.counts.size_bytes()},
          {"keyframe_poses", k.pose.size_bytes() + k.has_pose.size_bytes()},
          {"record", model.record().size()}};
}

Json Locations(const ModelView& model) {
  const ModelScoring& s = model.scoring();
  Json locations = Json::array();
  for (int l = 0; l < s.num_locations; ++l) {
    locations.push_back({{"name", model.location_name(l)}, {"views", Json::array()}});
  }
  for (int p = 0; p < s.num_pairs; ++p) {
    const auto keyframes = std::count(model.keyframes().pair.begin(),
                                      model.keyframes().pair.end(), p);
    locations[s.pair_location[p]]["views"].push_back(
        {{"name", model.view_name(s.pair_view[p])}, {"keyframes", keyframes}});
  }
  return locations;
}

Json Describe(const ModelView& model) {
  const ModelFeatures& f = model.features();
  const auto hash = model.short_hash();
  const auto& poses = model.keyframes().has_pose;
  Json json;
  json["hash"] = std::string(hash.begin(), hash.end());
  json["format_version"] = kModelFormatVersion;
  json["bytes"] = model.bytes().size();
  json["sections"] = Sections(model);
  json["features"] = {{"type", f.type == 1 ? "surf" : "sift"},
                      {"version", f.version},
                      {"descriptor_dim", f.descriptor_dim},
                      {"max_image_side", f.max_image_side},
                      {"max_features", f.max_features},
                      {"upright", f.upright},
                      {"threshold", f.threshold}};
  json["words"] = model.vocabulary().num_words;
  json["words_per_feature"] = model.vocabulary().words_per_feature;
  json["keyframe_weight"] = model.scoring().keyframe_weight;
  json["histogram_map"] =
      model.scoring().histogram_map == HistogramMap::kHellinger ? "hellinger" : "l1";
  json["keyframes"] = model.keyframes().size;
  json["keyframes_with_pose"] = std::count(poses.begin(), poses.end(), std::uint8_t{1});
  json["metric"] = model.metric();
  json["confidence"] = {{"offset", model.confidence().offset},
                        {"slope", model.confidence().slope},
                        {"threshold", model.confidence().threshold}};
  json["locations"] = Locations(model);
  json["training"] = Json::parse(model.record(), nullptr, false);
  if (json["training"].is_discarded()) json["training"] = nullptr;
  return json;
}

void PrintForPeople(const std::string& path, const Json& d) {
  std::printf("%s  %s  format %d, %.2f MB\n", path.c_str(), d["hash"].get<std::string>().c_str(),
              d["format_version"].get<int>(), d["bytes"].get<double>() / 1e6);
  for (const auto& [name, bytes] : d["sections"].items()) {
    std::printf("  %-22s %9d bytes\n", name.c_str(), bytes.get<int>());
  }
  const Json& f = d["features"];
  std::printf("features   %s version %d, %d a frame, longest side %d%s\n",
              f["type"].get<std::string>().c_str(), f["version"].get<int>(),
              f["max_features"].get<int>(), f["max_image_side"].get<int>(),
              f["upright"].get<bool>() ? ", upright" : "");
  std::printf("words      %d, %s\n", d["words"].get<int>(),
              d["histogram_map"].get<std::string>().c_str());
  std::printf("keyframes  %d, %d with a pose\n", d["keyframes"].get<int>(),
              d["keyframes_with_pose"].get<int>());
  if (d["training"].is_object() && d["training"].contains("chosen")) {
    std::printf("training   %s\n", d["training"]["chosen"].dump().c_str());
  }
  std::printf("locations  %zu\n", d["locations"].size());
  for (const Json& location : d["locations"]) {
    std::printf("  %-32s", location["name"].get<std::string>().c_str());
    for (const Json& view : location["views"]) {
      std::printf(" %s:%d", view["name"].get<std::string>().c_str(), view["keyframes"].get<int>());
    }
    std::printf("\n");
  }
}

void RunInspect(const InspectFlags& flags) {
  const auto bytes = ReadModelFile(flags.model);
  const Result<ModelView> model = ModelView::Open(bytes);
  if (!model.ok()) throw ToolError(flags.model + ": " + model.status().text());
  const Json description = Describe(*model);
  if (flags.json) {
    std::printf("%s\n", description.dump(1).c_str());
  } else {
    PrintForPeople(flags.model, description);
  }
}

}  // namespace

std::vector<unsigned char> ReadModelFile(const std::string& path) {
  auto bytes = ReadFile(path);
  if (!bytes.ok()) {
    throw ToolError(std::string(bytes.status().text()) + ": " +
                    std::string(bytes.status().detail()));
  }
  return std::move(*bytes);
}

void AddInspect(CLI::App& app) {
  auto flags = std::make_shared<InspectFlags>();
  CLI::App* command = app.add_subcommand(
      "inspect", "show what a model holds\nExample: viewfix inspect museum.vfx");
  command->add_option("model", flags->model, "the model file")->required();
  command->add_flag("--json", flags->json, "as JSON");
  command->callback([flags] { RunInspect(*flags); });
}

}  // namespace viewfix
