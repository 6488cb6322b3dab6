// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>

#include "engine/geometry/rigid3.h"

namespace viewfix {

// Where a moving camera should be next: as it moved between its last two poses. Counts frames,
// not seconds, so that a recording gives the same whatever the speed it is read at. No heap.
class MotionModel {
 public:
  // So many frames later nothing is known any more.
  static constexpr std::uint64_t kMaxGap = 10;

  struct Prediction {
    int map_idx = 0;
    Rigid3 cam_from_world;
  };

  // Frame `sequence` was localized. Frames not in order, and another map, begin anew.
  void Update(std::uint64_t sequence, int map_idx, const Rigid3& world_from_cam);
  // A frame was not: what was known of the motion is forgotten.
  void Lose() { last_.reset(), before_.reset(); }
  // For frame `sequence`. Nothing: no pose in the kMaxGap frames before it.
  std::optional<Prediction> Predict(std::uint64_t sequence) const;

 private:
  struct Known {
    std::uint64_t sequence;
    int map_idx;
    Rigid3 world_from_cam;
  };
  std::optional<Known> last_;
  std::optional<Known> before_;  // the one before last_, in the same map
};

}  // namespace viewfix
