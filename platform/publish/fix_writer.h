// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

#include "engine/localizer.h"
#include "models/model_view.h"
#include "platform/publish/json_line.h"

namespace viewfix {

struct FrameTimes {
  std::uint64_t sequence = 0;
  std::int64_t capture_time_ns = 0;  // CLOCK_MONOTONIC
  std::int64_t capture_utc_ns = 0;   // the same moment since 1970-01-01 UTC
  std::int64_t age_ns = 0;           // from capture to now
};

// Writes fixes as JSON lines: one object a frame, always the same keys in the same order.
//   location, view, keyframe  null unless localized; "level" counts the answered parts of
//                             the location's slash-separated name; with less than the whole
//                             of it, view and keyframe are null
//   rivals                    other locations close to the best, best first, also when not
//                             localized; when ambiguous, the best stands before them unless
//                             `location` says it
//   pose                      null unless this very frame was localized against landmarks
// Equal fixes give equal text on every processor. No heap. One instance serves one thread.
class FixWriter {
 public:
  // `model` is borrowed and must outlive the writer.
  explicit FixWriter(const ModelView& model);

  // The line with its '\n'; valid until the next call.
  std::string_view Write(const FrameTimes& times, const Fix& fix);

 private:
  void Times(const FrameTimes& times);
  void Answer(const Fix& fix);
  void Rivals(const Fix& fix);
  void Keyframe(const Fix& fix);
  void KeyframePose(int keyframe_idx);
  void PoseIn(int map_idx, std::span<const float> t, std::span<const float> q_xyzw);
  void Pose(const Fix& fix);
  void Reasons(const Fix& fix);
  void StageMs(const StageTimes& ms);

  const ModelView& model_;
  std::array<char, 16> model_hash_;
  JsonLine line_;
};

}  // namespace viewfix
