// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pose/window_adjuster.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

#include "engine/pose/pose_refiner.h"
#include "tests/engine/geometry/test_cameras.h"
#include "tests/engine/pose/pose_problem.h"

namespace viewfix {
namespace {

constexpr double kFrameTime = 0.05;

WindowAdjuster Make(const WindowAdjusterOptions& options = {}) {
  auto adjuster = WindowAdjuster::Create(options);
  EXPECT_TRUE(adjuster.ok());
  return std::move(*adjuster);
}

// A walk along a gentle curve that looks ahead and swings a little: at most 0.8 m/s^2 and
// 0.3 rad/s^2.
Rigid3 WalkAt(double time_s) {
  const Eigen::Vector3d centre(1.2 * time_s, 0.3 * std::sin(time_s), 0.02 * std::sin(6 * time_s));
  const Eigen::AngleAxisd turn(0.3 * std::sin(time_s), Eigen::Vector3d::UnitY());
  return Inverse({Eigen::Quaterniond(turn), centre});
}

// Few landmarks with coarse key points: what a pose of its own is poor at.
std::vector<PoseMatch> MatchesAt(const Rigid3& cam_from_world, int count, std::mt19937& random) {
  PoseProblem problem = MakePoseProblem(PinholeCamera(), {.num_matches = count}, random);
  for (PoseMatch& match : problem.matches) {
    const Eigen::Vector3d in_cam = problem.cam_from_world * match.point_in_world;
    match.point_in_world = Inverse(cam_from_world) * in_cam;
  }
  return problem.matches;
}

struct WalkErrors {
  double alone = 0;  // sums of squared errors in sigmas of the frame alone
  double window = 0;
  double nees = 0;  // mean normalized error squared of the window's newest pose
};

WalkErrors Walk(const WindowAdjusterOptions& options, int walks) {
  WalkErrors errors;
  int frames = 0;
  std::mt19937 random(1);
  for (int walk = 0; walk < walks; ++walk) {
    WindowAdjuster adjuster = Make(options);
    for (int i = 0; i < 20; ++i) {
      const Rigid3 truth = WalkAt(walk + kFrameTime * i);
      const auto matches = MatchesAt(truth, 12, random);
      const Camera camera = PinholeCamera();
      const RefinedPose alone = RefinePose(camera, matches, {}, truth, {});
      EXPECT_TRUE(alone.found);
      const AdjustedPose window =
          adjuster.Push(kFrameTime * i, camera, matches, alone.cam_from_world);
      EXPECT_TRUE(window.found);
      if (i + 1 < options.max_frames) continue;
      const auto scale = alone.covariance.ldlt();
      const auto alone_error = PoseError(alone.cam_from_world, truth);
      const auto error = PoseError(window.cam_from_world, truth);
      errors.alone += alone_error.dot(scale.solve(alone_error));
      errors.window += error.dot(scale.solve(error));
      errors.nees += error.dot(window.covariance.ldlt().solve(error));
      ++frames;
    }
  }
  errors.nees /= frames;
  return errors;
}

TEST(WindowAdjuster, NeighboursMakeAPoseBetter) {
  for (const int frames : {3, 5, 8}) {
    const WalkErrors errors = Walk(
        {.max_frames = frames, .acceleration_sigma = 0.7, .angular_acceleration_sigma = 0.4}, 20);
    RecordProperty("ratio_" + std::to_string(frames), std::to_string(errors.window / errors.alone));
    EXPECT_LT(errors.window, (frames < 5 ? 0.9 : 0.8) * errors.alone) << frames;
    // The walk is smoother than the stated sigmas allow for: at most the mean of chi squared.
    EXPECT_LT(errors.nees, 6.5) << frames;
    EXPECT_GT(errors.nees, 2) << frames;
  }
}

TEST(WindowAdjuster, OneFrameIsThePoseAlone) {
  std::mt19937 random(2);
  const PoseProblem problem = MakePoseProblem(PinholeCamera(), {.num_matches = 40}, random);
  const RefinedPose alone =
      RefinePose(problem.camera, problem.matches, {}, problem.cam_from_world, {});
  const AdjustedPose window = Make().Push(0, problem.camera, problem.matches, alone.cam_from_world);
  ASSERT_TRUE(window.found);
  EXPECT_LT(PoseError(window.cam_from_world, alone.cam_from_world).norm(), 1e-5);
  EXPECT_TRUE(window.covariance.isApprox(alone.covariance, 1e-3));
}

TEST(WindowAdjuster, WithoutNoiseSteadyMotionIsFoundExactly) {
  std::mt19937 random(3);
  WindowAdjuster adjuster = Make({.max_frames = 8});
  Rigid3 world_from_cam = RandomPose(random);
  const Eigen::Quaterniond turn = Eigen::Quaterniond(1, 0.01, 0.02, -0.01).normalized();
  for (int i = 0; i < 12; ++i) {
    world_from_cam.rotation = turn * world_from_cam.rotation;
    world_from_cam.translation += Eigen::Vector3d(0.05, 0.02, -0.01);
    const Rigid3 truth = Inverse(world_from_cam);
    PoseProblem problem =
        MakePoseProblem(TestCameras()[i % 5], {.num_matches = 30, .noise = 0}, random);
    for (PoseMatch& match : problem.matches) {
      match.point_in_world = Inverse(truth) * (problem.cam_from_world * match.point_in_world);
    }
    const AdjustedPose pose = adjuster.Push(kFrameTime * i, problem.camera, problem.matches,
                                            Disturbed(truth, 0.02, 0.01, random));
    ASSERT_TRUE(pose.found);
    EXPECT_LT(PoseError(pose.cam_from_world, truth).norm(), 1e-5);
    EXPECT_EQ(adjuster.num_frames(), std::min(i + 1, 8));
  }
}

TEST(WindowAdjuster, AGapOrAStepBackBeginsAnew) {
  std::mt19937 random(4);
  WindowAdjuster adjuster = Make();
  const PoseProblem p = MakePoseProblem(PinholeCamera(), {.num_matches = 30}, random);
  const auto frames_after = [&](double time_s) {
    EXPECT_TRUE(adjuster.Push(time_s, p.camera, p.matches, p.cam_from_world).found);
    return adjuster.num_frames();
  };
  EXPECT_EQ(frames_after(0), 1);
  EXPECT_EQ(frames_after(0.1), 2);
  EXPECT_EQ(frames_after(5), 1);
  EXPECT_EQ(frames_after(5.1), 2);
  EXPECT_EQ(frames_after(5.1), 1);
  EXPECT_EQ(frames_after(4), 1);
  adjuster.Clear();
  EXPECT_EQ(adjuster.num_frames(), 0);
}

TEST(WindowAdjuster, HostileInputIsNotFoundAndLeavesNoTrace) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  std::mt19937 random(5);
  const PoseProblem p = MakePoseProblem(PinholeCamera(), {.num_matches = 30}, random);
  WindowAdjuster adjuster = Make();
  auto broken = p.matches;
  for (PoseMatch& match : broken) match.point_in_world.x() = kNan;
  Rigid3 nowhere = p.cam_from_world;
  nowhere.translation.y() = kNan;
  EXPECT_FALSE(adjuster.Push(0, p.camera, broken, p.cam_from_world).found);
  EXPECT_FALSE(adjuster.Push(1, p.camera, p.matches, nowhere).found);
  EXPECT_FALSE(adjuster.Push(2, p.camera, {}, p.cam_from_world).found);
  EXPECT_FALSE(adjuster.Push(kNan, p.camera, p.matches, p.cam_from_world).found);
  EXPECT_EQ(adjuster.num_frames(), 0);
  EXPECT_TRUE(adjuster.Push(3, p.camera, p.matches, p.cam_from_world).found);
}

TEST(WindowAdjuster, OptionsAreChecked) {
  EXPECT_TRUE(WindowAdjusterOptions{}.Validate().ok());
  EXPECT_FALSE(WindowAdjusterOptions{.max_frames = 2}.Validate().ok());
  EXPECT_FALSE(WindowAdjusterOptions{.max_frames = 9}.Validate().ok());
  EXPECT_FALSE(WindowAdjusterOptions{.capacity = 0}.Validate().ok());
  EXPECT_FALSE(WindowAdjusterOptions{.acceleration_sigma = 0}.Validate().ok());
  EXPECT_FALSE(WindowAdjusterOptions{.max_gap_s = 0}.Validate().ok());
  EXPECT_FALSE(WindowAdjusterOptions{.max_iterations = 0}.Validate().ok());
}

}  // namespace
}  // namespace viewfix
