// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <span>

#include "engine/base/status.h"
#include "engine/geometry/camera.h"
#include "engine/geometry/rigid3.h"
#include "engine/pose/pose_match.h"

namespace viewfix {

struct WindowAdjusterOptions {
  // Frames held at most, 3..kMaxFrames. The cost grows with it; what it gains levels off.
  int max_frames = 5;
  // Most matches of one frame, >= 3.
  int capacity = 1024;
  // How far a frame's motion departs from the one before it, as white acceleration: standard
  // deviations, > 0. Someone walking with the camera in the hand.
  double acceleration_sigma = 2.0;          // world units (metres) / s^2
  double angular_acceleration_sigma = 3.0;  // radians / s^2
  // Frames further apart than this tell nothing of each other's motion: the window begins
  // anew; seconds, > 0.
  double max_gap_s = 1.0;
  double huber_sigma = 3;   // as PoseRefinerOptions'
  int max_iterations = 10;  // 1..100

  Status Validate() const;
};

struct AdjustedPose {
  bool found = false;
  Rigid3 cam_from_world;
  // As RefinedPose's, with what the other frames add.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

// Adjustment over the last frames of a moving camera: all their poses together minimize the
// robust reprojection error of their matches, with landmarks that stay where they are, plus
//   |(c3 - c2) - (t32 / t21) (c2 - c1)|^2 / (acceleration_sigma t32 (t32 + t21) / 2)^2
// of every three frames' camera centres c in a row, t seconds apart, and the same of their
// rotations: the motion goes on as it was. Levenberg-Marquardt on one banded system, at most
// 8 frames by 6 parameters. Create() allocates; Push() does not, bounds its steps and is
// deterministic. One instance serves one thread.
class WindowAdjuster {
 public:
  static constexpr int kMaxFrames = 8;

  static Result<WindowAdjuster> Create(const WindowAdjusterOptions& options);
  WindowAdjuster(WindowAdjuster&&) noexcept;
  WindowAdjuster& operator=(WindowAdjuster&&) noexcept;
  ~WindowAdjuster();

  // Adds a frame, dropping the oldest of a full window, and adjusts them all. Returns the pose
  // of this frame.
  //   time_s          grows from frame to frame; else the window begins anew
  //   matches         inliers of the frame's own pose; those beyond the capacity are left out
  //   cam_from_world  the frame's own pose: where to start
  // Not found: fewer than 3 matches in sight of the start, or a result that is not finite;
  // the window is empty then.
  AdjustedPose Push(double time_s, const Camera& camera, std::span<const PoseMatch> matches,
                    const Rigid3& cam_from_world);

  // Forgets all frames: after a jump, or when the camera was lost.
  void Clear();

  int num_frames() const;
  // Oldest first, as adjusted by the last Push(); 0 <= frame_idx < num_frames().
  Rigid3 cam_from_world(int frame_idx) const;

 private:
  struct State;
  explicit WindowAdjuster(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace viewfix
