// SPDX-License-Identifier: BSD-3-Clause
#include "platform/publish/state_line.h"

namespace viewfix {

void WriteStateLine(const StateLine& state, JsonLine& line) {
  line.Clear();
  line.Raw("{\"schema\":1,\"seq\":");
  line.Integer(static_cast<std::int64_t>(state.sequence));
  line.Raw(",\"capture_time_ns\":");
  line.Integer(state.now_ns);
  line.Raw(",\"time\":");
  line.Time(state.now_utc_ns);
  line.Raw(",\"age_ms\":0,\"model\":");
  if (state.model.empty()) {
    line.Raw("null");
  } else {
    line.String(state.model);
  }
  line.Raw(",\"state\":");
  line.String(state.state);
  line.Raw(
      ",\"location\":null,\"level\":0,\"view\":null,\"confidence\":0,\"score\":0,\"margin\":0,"
      "\"rivals\":[],\"inliers\":0,\"keyframe\":null,\"pose\":null,\"reasons\":[],\"ms\":{"
      "\"features\":0,\"score\":0,\"verify\":0,\"pose\":0,\"total\":0},\"detail\":");
  line.String(state.detail);
  line.Raw("}\n");
}

}  // namespace viewfix
