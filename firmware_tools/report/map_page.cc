// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/report/map_page.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "engine/pose/model_geometry.h"
#include "firmware_tools/common/base64.h"
#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/dataset/tool_file.h"
#include "firmware_tools/report/page.h"
#include "platform/publish/map_json.h"

namespace viewfix {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint32_t kMaxPoints = 200'000;  // of a map; spread over all of them

template <typename Number>
std::string Base64Of(const std::vector<Number>& numbers) {
  return Base64(
      {reinterpret_cast<const std::uint8_t*>(numbers.data()), numbers.size() * sizeof(Number)});
}

Json Vector(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Json Quaternion(const Eigen::Quaterniond& q) { return {q.x(), q.y(), q.z(), q.w()}; }

std::uint16_t LocationOf(const ModelView& model, int keyframe_idx) {
  return model.scoring().pair_location[model.keyframes().pair[keyframe_idx]];
}

// The location of the first keyframe that sees each landmark.
std::vector<std::uint16_t> LandmarkLocations(const ModelView& model) {
  const ModelKeyframes& keyframes = model.keyframes();
  std::vector<std::uint16_t> locations(model.landmarks().size);
  if (locations.empty()) return locations;
  for (int k = keyframes.size - 1; k >= 0; --k) {
    const std::uint32_t begin = keyframes.landmark_begin[k];
    const std::uint32_t end = keyframes.landmark_begin[std::size_t(k) + 1];
    for (const std::uint32_t idx : keyframes.landmarks.subspan(begin, end - begin)) {
      locations[idx] = LocationOf(model, k);
    }
  }
  return locations;
}

// Little endian, as the model holds them: positions in steps from the origin.
Json Points(const ModelView& model, int map, const std::vector<std::uint16_t>& locations) {
  const ModelLandmarks& landmarks = model.landmarks();
  const std::uint32_t begin = landmarks.map_begin[map];
  const std::uint32_t end = landmarks.map_begin[std::size_t(map) + 1];
  const std::uint32_t step =
      std::max<std::uint32_t>(1, (end - begin + kMaxPoints - 1) / kMaxPoints);
  std::vector<std::int16_t> positions;
  std::vector<std::uint16_t> shown_locations;
  for (std::uint32_t i = begin; i < end; i += step) {
    const auto row = landmarks.position.subspan(std::size_t{3} * i, 3);
    positions.insert(positions.end(), row.begin(), row.end());
    shown_locations.push_back(locations[i]);
  }
  const auto origin = landmarks.map_origin.subspan(std::size_t(map) * 3, 3);
  return {{"count", shown_locations.size()},
          {"of", end - begin},
          {"origin", std::vector(origin.begin(), origin.end())},
          {"step", landmarks.map_step[map]},
          {"positions", Base64Of(positions)},
          {"locations", Base64Of(shown_locations)}};
}

Json Keyframes(const ModelView& model, int map) {
  Json keyframes = Json::array();
  for (int k = 0; k < model.keyframes().size; ++k) {
    if (model.keyframes().has_pose[k] == 0 || MapOfKeyframe(model, k) != map) continue;
    const Rigid3 pose = KeyframePose(model.keyframes(), k);
    keyframes.push_back({{"t", Vector(pose.translation)},
                         {"q", Quaternion(pose.rotation)},
                         {"location", LocationOf(model, k)},
                         {"view", model.scoring().pair_view[model.keyframes().pair[k]]},
                         {"name", model.keyframe_name(k)}});
  }
  return keyframes;
}

Json Maps(const ModelView& model) {
  const auto locations = LandmarkLocations(model);
  Json maps = Json::array();
  for (int map = 0; map < std::max(1, model.landmarks().num_maps); ++map) {
    maps.push_back({{"metric", model.metric(map)},
                    {"points", model.has_landmarks() ? Points(model, map, locations) : Json()},
                    {"keyframes", Keyframes(model, map)}});
  }
  return maps;
}

Json Names(int count, const auto& name_of) {
  Json names = Json::array();
  for (int i = 0; i < count; ++i) names.push_back(name_of(i));
  return names;
}

// Half the image's width and height at a distance of 1; of an unknown camera, a usual one's.
Json Opening(const ModelView& model) {
  const Camera camera = CameraOf(model.camera());
  if (camera.width == 0 || !(camera.fx > 0) || !(camera.fy > 0)) return {0.6, 0.45};
  return {camera.width / (2 * camera.fx), camera.height / (2 * camera.fy)};
}

std::string ScriptUrl(std::string_view script) {
  return "data:text/javascript;base64," +
         Base64({reinterpret_cast<const std::uint8_t*>(script.data()), script.size()});
}

// The library's files by the names under which they import each other.
Json ImportMap() {
  const PagePart core[] = {{"\"./three.core.min.js\"", "\"three-core\""}};
  return {{"imports",
           {{"three-core", ScriptUrl(ThreeCoreLibrary())},
            {"three", ScriptUrl(FillPage(ThreeLibrary(), core))},
            {"orbit-controls", ScriptUrl(OrbitControlsLibrary())}}}};
}

// Throws nlohmann's exceptions for anything else than numbers.
Json WalkStep(const Json& fix) {
  const Json& pose = fix.at("pose");
  const auto t = pose.at("t").get<std::array<double, 3>>();
  const auto q = pose.at("q_xyzw").get<std::array<double, 4>>();
  const Json location = fix.value("location", Json());
  return {{"t", t},
          {"q", q},
          {"map", pose.value("map", 0)},
          {"localized", fix.value("state", "") == "localized"},
          {"location", location.is_string() ? location : Json("")},
          {"confidence", fix.value("confidence", 0.0)}};
}

}  // namespace

Json ReadWalk(const std::string& file) {
  const std::string text = ReadTextFile(file);
  Json walk = Json::array();
  int number = 0;
  for (std::size_t from = 0; from < text.size();) {
    const std::size_t end = std::min(text.find('\n', from), text.size());
    const std::string_view line = std::string_view(text).substr(from, end - from);
    from = end + 1;
    number += 1;
    if (line.empty()) continue;
    try {
      const Json fix = Json::parse(line);
      if (fix.at("pose").is_object()) walk.push_back(WalkStep(fix));
    } catch (const Json::exception&) {
      throw ToolError(file + ": line " + std::to_string(number) +
                      ": not a fix of viewfixd as JSON");
    }
  }
  return walk;
}

void CheckMapLibraries(const std::string& what) {
  for (const auto library : {ThreeCoreLibrary(), ThreeLibrary(), OrbitControlsLibrary()}) {
    CheckLibrary(what, library, "three.js");
  }
}

void CheckHasMap(const std::string& model_file, const ModelView& model) {
  const auto has_pose = model.keyframes().has_pose;
  if (model.has_landmarks() || std::count(has_pose.begin(), has_pose.end(), 1) > 0) return;
  throw ToolError(model_file + ": the model has no map: train it with poses, or with --map colmap");
}

std::string MapHtml(const std::string& title, const ModelView& model, const Json& walk) {
  const auto hash = model.short_hash();
  const ModelScoring& scoring = model.scoring();
  const Json data = {
      {"title", title},
      {"hash", std::string(hash.begin(), hash.end())},
      {"locations", Names(scoring.num_locations, [&](int i) { return model.location_name(i); })},
      {"views", Names(scoring.num_views, [&](int i) { return model.view_name(i); })},
      {"opening", Opening(model)},
      {"floor_plan", FloorPlanForPage(model)},
      {"maps", Maps(model)},
      {"walk", walk}};
  const std::string script_data = ScriptJson(data);
  const std::string import_map = ScriptJson(ImportMap());
  const PagePart parts[] = {
      {"/*STYLE*/", PageStyle()}, {"/*IMPORTS*/", import_map}, {"/*DATA*/", script_data}};
  return FillPage(MapPage(), parts);
}

}  // namespace viewfix
