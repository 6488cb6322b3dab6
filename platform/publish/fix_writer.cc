// SPDX-License-Identifier: BSD-3-Clause
#include "platform/publish/fix_writer.h"

#include <algorithm>
#include <array>

#include "engine/base/location_name.h"

namespace viewfix {
namespace {

// Names of at most 255 bytes (models/viewfix.fbs), each of which can become "\u00XX"; the
// other parts of a line are numbers and fixed words.
constexpr std::size_t kMaxNameBytes = 255;
constexpr std::size_t kMaxNames = 2 + Fix::kMaxRivals;  // location, view or guess, rivals
constexpr std::size_t kMaxRestBytes = 2048;
static_assert(kMaxNames * (6 * kMaxNameBytes + 3) + kMaxRestBytes <= JsonLine::kCapacity);

void AppendFloats(std::span<const float> values, JsonLine& line) {
  const char* separator = "[";
  for (const float value : values) {
    line.Raw(separator);
    line.Float(value);
    separator = ",";
  }
  line.Raw("]");
}

}  // namespace

FixWriter::FixWriter(const ModelView& model) : model_(model), model_hash_(model.short_hash()) {}

std::string_view FixWriter::Write(const FrameTimes& times, const Fix& fix) {
  line_.Clear();
  Times(times);
  Answer(fix);
  Rivals(fix);
  line_.Raw(",\"inliers\":");
  line_.Integer(fix.num_inliers);
  Keyframe(fix);
  Pose(fix);
  Reasons(fix);
  StageMs(fix.ms);
  line_.Raw("}\n");
  return line_.text();
}

void FixWriter::Times(const FrameTimes& times) {
  line_.Raw("{\"schema\":1,\"seq\":");
  line_.Integer(static_cast<std::int64_t>(times.sequence));
  line_.Raw(",\"capture_time_ns\":");
  line_.Integer(times.capture_time_ns);
  line_.Raw(",\"time\":");
  line_.Time(times.capture_utc_ns);
  line_.Raw(",\"age_ms\":");
  line_.Float(static_cast<float>(times.age_ns) * 1e-6F);
  line_.Raw(",\"model\":");
  line_.String({model_hash_.data(), model_hash_.size()});
}

void FixWriter::Answer(const Fix& fix) {
  if (fix.localized) {
    const std::string_view name = model_.location_name(fix.location_idx);
    const int level = fix.level == 0 ? LevelsOf(name) : fix.level;
    line_.Raw(",\"state\":\"localized\",\"location\":");
    line_.String(UpToLevel(name, level));
    line_.Raw(",\"level\":");
    line_.Integer(level);
    line_.Raw(",\"view\":");
    if (fix.level == 0) {
      line_.String(model_.view_name(model_.scoring().pair_view[fix.pair_idx]));
    } else {
      line_.Raw("null");
    }
  } else {
    line_.Raw(",\"state\":\"not_localized\",\"location\":null,\"level\":0,\"view\":null");
  }
  line_.Raw(",\"confidence\":");
  line_.Float(fix.confidence);
  line_.Raw(",\"score\":");
  line_.Float(fix.score);
  line_.Raw(",\"margin\":");
  line_.Float(fix.margin);
}

void FixWriter::Rivals(const Fix& fix) {
  line_.Raw(",\"rivals\":[");
  const char* separator = "";
  const auto name = [&](int location_idx) {
    line_.Raw(separator);
    line_.String(model_.location_name(location_idx));
    separator = ",";
  };
  if (fix.GuessIsRival()) name(fix.location_idx);
  for (int i = 0; i < fix.num_rivals; ++i) name(fix.rivals[i]);
  line_.Raw("]");
}

void FixWriter::Keyframe(const Fix& fix) {
  line_.Raw(",\"keyframe\":");
  if (!fix.localized || fix.level != 0 || fix.keyframe_idx < 0) return line_.Raw("null");
  line_.Raw("{\"id\":");
  line_.Integer(fix.keyframe_idx);
  line_.Raw(",\"pose\":");
  KeyframePose(fix.keyframe_idx);
  line_.Raw("}");
}

void FixWriter::KeyframePose(int keyframe_idx) {
  const ModelKeyframes& keyframes = model_.keyframes();
  if (keyframes.has_pose[keyframe_idx] == 0) return line_.Raw("null");
  const std::span<const float> pose = keyframes.pose.subspan(std::size_t(keyframe_idx) * 7, 7);
  const auto& begin = keyframes.landmark_begin;
  const bool mapped = !begin.empty() && begin[keyframe_idx] < begin[std::size_t(keyframe_idx) + 1];
  PoseIn(mapped ? model_.MapOf(keyframes.landmarks[begin[keyframe_idx]]) : 0, pose.first(3),
         pose.last(4));
  line_.Raw("}");
}

void FixWriter::PoseIn(int map_idx, std::span<const float> t, std::span<const float> q_xyzw) {
  line_.Raw("{\"frame\":\"world_from_cam\",\"map\":");
  line_.Integer(map_idx);
  line_.Raw(",\"metric\":");
  line_.Raw(model_.metric(map_idx) ? "true" : "false");
  line_.Raw(",\"t\":");
  AppendFloats(t, line_);
  line_.Raw(",\"q_xyzw\":");
  AppendFloats(q_xyzw, line_);
}

void FixWriter::Pose(const Fix& fix) {
  line_.Raw(",\"pose\":");
  if (!fix.has_pose) return line_.Raw("null");
  const auto t = fix.world_from_cam.translation.cast<float>().eval();
  const auto q = fix.world_from_cam.rotation.coeffs().cast<float>().eval();  // x y z w
  PoseIn(fix.map_idx, {t.data(), 3}, {q.data(), 4});
  std::array<float, 21> covariance;
  auto next = covariance.begin();
  for (int row = 0; row < 6; ++row) {
    for (int col = row; col < 6; ++col) *next++ = static_cast<float>(fix.covariance(row, col));
  }
  line_.Raw(",\"covariance\":");
  AppendFloats(covariance, line_);
  line_.Raw("}");
}

void FixWriter::Reasons(const Fix& fix) {
  line_.Raw(",\"reasons\":[");
  const char* separator = "";
  for (const Reason reason : kAllReasons) {
    if ((fix.reasons & reason) == 0) continue;
    line_.Raw(separator);
    line_.String(ReasonName(reason));
    separator = ",";
  }
  line_.Raw("]");
}

void FixWriter::StageMs(const StageTimes& ms) {
  line_.Raw(",\"ms\":{\"features\":");
  line_.Float(ms.features);
  line_.Raw(",\"score\":");
  line_.Float(ms.score);
  line_.Raw(",\"verify\":");
  line_.Float(ms.verify);
  line_.Raw(",\"pose\":");
  line_.Float(ms.pose);
  line_.Raw(",\"total\":");
  line_.Float(ms.total);
  line_.Raw("}");
}

}  // namespace viewfix
