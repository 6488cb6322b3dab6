// SPDX-License-Identifier: BSD-3-Clause
#include <malloc.h>

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "engine/localizer.h"
#include "firmware_tools/cli/commands.h"
#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/evaluation/evaluate.h"
#include "firmware_tools/mapping/model_export.h"
#include "models/model_view.h"

namespace viewfix {
namespace {

using Json = nlohmann::ordered_json;

struct InspectFlags {
  std::string model;
  bool json = false;
};

Json Locations(const ModelView& model) {
  const ModelScoring& s = model.scoring();
  Json locations = Json::array();
  for (int l = 0; l < s.num_locations; ++l) {
    locations.push_back({{"name", model.location_name(l)}, {"views", Json::array()}});
  }
  for (int p = 0; p < s.num_pairs; ++p) {
    const auto keyframes =
        std::count(model.keyframes().pair.begin(), model.keyframes().pair.end(), p);
    locations[s.pair_location[p]]["views"].push_back(
        {{"name", model.view_name(s.pair_view[p])}, {"keyframes", keyframes}});
  }
  return locations;
}

// The box that a map's points and cameras fill.
Json ExtentOf(const Reconstruction& map) {
  Eigen::AlignedBox3d box;
  for (const MapPoint& point : map.points) box.extend(point.position);
  for (const MapImage& image : map.images) box.extend(Inverse(image.cam_from_world).translation);
  if (box.isEmpty()) return nullptr;
  const Eigen::Vector3d& low = box.min();
  const Eigen::Vector3d& high = box.max();
  return {{"min", {low.x(), low.y(), low.z()}}, {"max", {high.x(), high.y(), high.z()}}};
}

Json Maps(const ModelView& model) {
  Json maps = Json::array();
  for (const Reconstruction& map : MapsOfModel(model)) {
    const int m = static_cast<int>(maps.size());
    maps.push_back({{"landmarks", map.points.size()},
                    {"keyframes", map.images.size()},
                    {"metric", model.metric(m)},
                    {"position_error", model.landmarks().map_step[m] / 2},
                    {"extent", ExtentOf(map)}});
  }
  return maps;
}

Json CameraAsJson(const ModelCamera& camera) {
  if (camera.width == 0) return nullptr;
  constexpr const char* kModels[] = {"unknown", "pinhole", "brown_conrady", "kannala_brandt"};
  return {{"model", kModels[camera.model <= 3 ? camera.model : 0]},
          {"width", camera.width},
          {"height", camera.height},
          {"fx_fy_cx_cy", std::vector(camera.intrinsics.begin(), camera.intrinsics.end())},
          {"distortion", std::vector(camera.distortion.begin(), camera.distortion.end())}};
}

Json FloorPlanAsJson(const ModelFloorPlan& plan) {
  if (plan.picture.empty()) return nullptr;
  return {
      {"bytes", plan.picture.size()},
      {"width", plan.width},
      {"height", plan.height},
      {"site_from_pixel", std::vector(plan.site_from_pixel.begin(), plan.site_from_pixel.end())}};
}

std::size_t HeapBytes() {
  const struct mallinfo2 heap = mallinfo2();
  return heap.uordblks + heap.hblkhd;
}

// What a localizer takes besides the model, all of it in Open() and Create(): counted by making
// one. None for features that no board has, or where the heap does not count (AddressSanitizer's).
std::optional<std::size_t> LocalizerBytes(const ModelView& model) {
  const std::size_t before = HeapBytes();
  const Result<ModelView> view = ModelView::Open(model.bytes());
  if (!view.ok()) return std::nullopt;
  const Result<Localizer> localizer = Localizer::Create(*view, {});
  if (!localizer.ok() || HeapBytes() <= before) return std::nullopt;
  return HeapBytes() - before;
}

Json Describe(const ModelView& model) {
  const ModelFeatures& f = model.features();
  const auto hash = model.short_hash();
  const auto& poses = model.keyframes().has_pose;
  Json json;
  json["hash"] = std::string(hash.begin(), hash.end());
  json["format_version"] = kModelFormatVersion;
  json["bytes"] = model.bytes().size();
  json["sections"] = SectionsAsJson(model);
  const std::optional<std::size_t> memory = LocalizerBytes(model);
  json["localizer_bytes"] = memory ? Json(*memory) : Json(nullptr);
  json["features"] = {{"type", FeatureTypeName(static_cast<FeatureType>(f.type))},
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
  json["landmarks"] = model.landmarks().size;
  json["details"] = model.details().size;
  json["maps"] = Maps(model);
  json["camera"] = CameraAsJson(model.camera());
  json["floor_plan"] = FloorPlanAsJson(model.floor_plan());
  json["confidence"] = {{"offset", model.confidence().offset},
                        {"slope", model.confidence().slope},
                        {"threshold", model.confidence().threshold}};
  const std::optional<ModelPoseConfidence>& of_pose = model.pose_confidence();
  json["pose_confidence"] = of_pose ? Json{{"threshold", of_pose->threshold}} : Json(nullptr);
  json["locations"] = Locations(model);
  json["training"] = Json::parse(model.record(), nullptr, false);
  if (json["training"].is_discarded()) json["training"] = nullptr;
  return json;
}

void PrintMaps(const Json& d) {
  std::printf("landmarks  %d in %zu maps\n", d["landmarks"].get<int>(), d["maps"].size());
  for (std::size_t m = 0; m < d["maps"].size(); ++m) {
    const Json& map = d["maps"][m];
    std::printf("  map %zu    %d landmarks, %d keyframes", m, map["landmarks"].get<int>(),
                map["keyframes"].get<int>());
    for (int axis = 0; axis < 3 && !map["extent"].is_null(); ++axis) {
      std::printf(
          "%s%.1f", axis == 0 ? ", " : " x ",
          map["extent"]["max"][axis].get<double>() - map["extent"]["min"][axis].get<double>());
    }
    std::printf(" %s\n", map["metric"].get<bool>() ? "m" : "units of its own");
  }
  if (const Json& camera = d["camera"]; !camera.is_null()) {
    std::printf("camera     %s, %d x %d, focal length %.1f pixels\n",
                camera["model"].get<std::string>().c_str(), camera["width"].get<int>(),
                camera["height"].get<int>(), camera["fx_fy_cx_cy"][0].get<double>());
  }
  if (const Json& plan = d["floor_plan"]; !plan.is_null()) {
    const double a = plan["site_from_pixel"][0].get<double>();
    const double b = plan["site_from_pixel"][1].get<double>();
    std::printf("floor plan %d x %d pixels of %.3f m\n", plan["width"].get<int>(),
                plan["height"].get<int>(), std::hypot(a, b));
  }
}

void PrintForPeople(const std::string& path, const Json& d) {
  std::printf("%s  %s  format %d, %.2f MB\n", path.c_str(), d["hash"].get<std::string>().c_str(),
              d["format_version"].get<int>(), d["bytes"].get<double>() / 1e6);
  for (const auto& [name, bytes] : d["sections"].items()) {
    std::printf("  %-22s %9d bytes\n", name.c_str(), bytes.get<int>());
  }
  if (const Json& memory = d["localizer_bytes"]; !memory.is_null()) {
    std::printf("memory     %.2f MB besides the model, taken once\n", memory.get<double>() / 1e6);
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
  PrintMaps(d);
  std::printf("details    %d\n", d["details"].get<int>());
  std::printf("answers    from a confidence of %.3f on",
              d["confidence"]["threshold"].get<double>());
  if (const Json& of_pose = d["pose_confidence"]; !of_pose.is_null()) {
    std::printf(", with a pose from %.3f", of_pose["threshold"].get<double>());
  }
  std::printf("\n");
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

void AddInspect(CLI::App& app) {
  auto flags = std::make_shared<InspectFlags>();
  CLI::App* command =
      app.add_subcommand("inspect", "show what a model holds\nExample: viewfix inspect museum.vfx");
  command->add_option("model", flags->model, "the model file")->required();
  command->add_flag("--json", flags->json, "as JSON");
  command->callback([flags] { RunInspect(*flags); });
}

}  // namespace viewfix
