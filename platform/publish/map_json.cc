// SPDX-License-Identifier: BSD-3-Clause
#include "platform/publish/map_json.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "platform/publish/json_line.h"

namespace viewfix {
namespace {

constexpr std::uint32_t kMaxPoints = 3000;
constexpr int kMaxKeyframes = 1000;

// Numbers to millimetres; keeps the text short.
void AppendNumber(std::string& text, double value) {
  char digits[32];
  const double rounded = std::isfinite(value) ? std::round(value * 1000) / 1000 : 0;
  text.append(digits, std::to_chars(digits, digits + sizeof digits, rounded).ptr);
}

void AppendExact(std::string& text, double value) {
  char digits[32];
  text.append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
}

void AppendString(std::string& text, std::string_view name) {
  JsonLine line;
  line.Clear();
  line.String(name);
  text.append(line.text());
}

void AppendFloorPlan(const ModelFloorPlan& plan, std::string& text) {
  text.append("{\"width\":").append(std::to_string(plan.width));
  text.append(",\"height\":").append(std::to_string(plan.height)).append(",\"site_from_pixel\":");
  const char* separator = "[";
  for (const double value : plan.site_from_pixel) {
    text.append(separator);
    AppendExact(text, value);
    separator = ",";
  }
  text.append("]}");
}

void AppendPoints(const ModelLandmarks& landmarks, std::string& text) {
  const std::uint32_t count = landmarks.size == 0 ? 0 : landmarks.map_begin[1];
  const std::uint32_t step = std::max<std::uint32_t>(1, (count + kMaxPoints - 1) / kMaxPoints);
  text.append("[");
  for (std::uint32_t i = 0; i < count; i += step) {
    text.append(i == 0 ? "[" : ",[");
    for (int axis = 0; axis < 2; ++axis) {
      const float at = landmarks.map_origin[axis] +
                       landmarks.map_step[0] * landmarks.position[std::size_t{3} * i + axis];
      if (axis > 0) text.append(",");
      AppendNumber(text, at);
    }
    text.append("]");
  }
  text.append("]");
}

// The z axis of world_from_cam's rotation, seen from above.
std::array<double, 2> ViewDirection(std::span<const float> q) {
  const double x = q[0], y = q[1], z = q[2], w = q[3];
  return {2 * (x * z + w * y), 2 * (y * z - w * x)};
}

void AppendKeyframe(const ModelView& model, int keyframe_idx, std::string& text) {
  const ModelKeyframes& keyframes = model.keyframes();
  const std::span<const float> pose = keyframes.pose.subspan(std::size_t(keyframe_idx) * 7, 7);
  const auto direction = ViewDirection(pose.last(4));
  const auto pair = keyframes.pair[keyframe_idx];
  text.append("{\"x\":");
  AppendNumber(text, pose[0]);
  text.append(",\"y\":");
  AppendNumber(text, pose[1]);
  text.append(",\"dx\":");
  AppendNumber(text, direction[0]);
  text.append(",\"dy\":");
  AppendNumber(text, direction[1]);
  text.append(",\"location\":");
  text.append(std::to_string(model.scoring().pair_location[pair])).append("}");
}

void AppendKeyframes(const ModelView& model, std::string& text) {
  const ModelKeyframes& keyframes = model.keyframes();
  const int step = std::max(1, (keyframes.size + kMaxKeyframes - 1) / kMaxKeyframes);
  const char* separator = "";
  text.append("[");
  for (int i = 0; i < keyframes.size; i += step) {
    if (keyframes.has_pose[i] == 0 || MapOfKeyframe(model, i) != 0) continue;
    text.append(separator);
    AppendKeyframe(model, i, text);
    separator = ",";
  }
  text.append("]");
}

}  // namespace

int MapOfKeyframe(const ModelView& model, int keyframe_idx) {
  const auto& begin = model.keyframes().landmark_begin;
  if (begin.empty() || begin[keyframe_idx] == begin[std::size_t(keyframe_idx) + 1]) return 0;
  return model.MapOf(model.keyframes().landmarks[begin[keyframe_idx]]);
}

std::string MapJson(const ModelView& model) {
  const auto hash = model.short_hash();
  std::string text = "{\"schema\":1,\"model\":";
  AppendString(text, {hash.data(), hash.size()});
  text.append(",\"metric\":").append(model.metric(0) ? "true" : "false");
  text.append(",\"floor_plan\":");
  if (model.has_floor_plan()) {
    AppendFloorPlan(model.floor_plan(), text);
  } else {
    text.append("null");
  }
  text.append(",\"points\":");
  AppendPoints(model.landmarks(), text);
  text.append(",\"keyframes\":");
  AppendKeyframes(model, text);
  text.append(",\"locations\":[");
  for (int i = 0; i < model.scoring().num_locations; ++i) {
    if (i > 0) text.append(",");
    AppendString(text, model.location_name(i));
  }
  return text.append("]}\n");
}

}  // namespace viewfix
