// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pose/absolute_pose.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <limits>

#include "tests/engine/geometry/test_cameras.h"
#include "tests/engine/pose/pose_problem.h"

namespace viewfix {
namespace {

AbsolutePoseEstimator Make(const AbsolutePoseOptions& options = {}) {
  auto estimator = AbsolutePoseEstimator::Create(options);
  EXPECT_TRUE(estimator.ok());
  return std::move(*estimator);
}

// How many of `runs` problems end within 10 cm and 0.03 rad of the truth.
int CountSolved(const Camera& camera, const PoseProblemOptions& options, int runs,
                const AbsolutePoseOptions& estimation = {}) {
  std::mt19937 random(1);
  AbsolutePoseEstimator estimator = Make(estimation);
  int solved = 0;
  for (int i = 0; i < runs; ++i) {
    const PoseProblem problem = MakePoseProblem(camera, options, random);
    const AbsolutePose pose = estimator.Estimate(camera, problem.matches);
    const auto error = PoseError(pose.pose.cam_from_world, problem.cam_from_world);
    solved += pose.found && error.head<3>().norm() < 0.1 && error.tail<3>().norm() < 0.03;
  }
  return solved;
}

TEST(AbsolutePose, FindsThePoseAmongWrongMatches) {
  for (const Camera& camera : TestCameras()) {
    EXPECT_EQ(CountSolved(camera, {.num_matches = 300, .share_true = 0.7}, 50), 50);
    EXPECT_EQ(CountSolved(camera, {.num_matches = 600, .share_true = 0.3}, 50), 50);
  }
}

TEST(AbsolutePose, SurvivesNinetyPercentWrongMatches) {
  EXPECT_GE(CountSolved(PinholeCamera(), {.num_matches = 600, .share_true = 0.15}, 100), 99);
  EXPECT_GE(CountSolved(PinholeCamera(), {.num_matches = 600, .share_true = 0.1}, 100,
                        {.max_iterations = 20000}),
            97);
}

TEST(AbsolutePose, TheMaskNamesTheRightMatches) {
  std::mt19937 random(2);
  AbsolutePoseEstimator estimator = Make();
  for (int i = 0; i < 20; ++i) {
    const PoseProblem problem =
        MakePoseProblem(PinholeCamera(), {.num_matches = 400, .share_true = 0.4}, random);
    const AbsolutePose pose = estimator.Estimate(problem.camera, problem.matches);
    ASSERT_TRUE(pose.found);
    const auto mask = estimator.inliers();
    ASSERT_EQ(mask.size(), 400);
    int true_kept = 0, false_kept = 0, total_true = 0;
    for (int k = 0; k < 400; ++k) {
      total_true += problem.is_true[k];
      (problem.is_true[k] ? true_kept : false_kept) += mask[k];
    }
    EXPECT_EQ(true_kept + false_kept, pose.num_inliers);
    EXPECT_GE(true_kept, 0.97 * total_true);
    EXPECT_LE(false_kept, 3);
    EXPECT_LE(pose.score, pose.num_inliers);
  }
}

TEST(AbsolutePose, CovarianceIsHonest) {
  std::mt19937 random(3);
  AbsolutePoseEstimator estimator = Make();
  double sum = 0;
  constexpr int kRuns = 600;
  for (int i = 0; i < kRuns; ++i) {
    const PoseProblem problem =
        MakePoseProblem(PinholeCamera(), {.num_matches = 120, .share_true = 0.6}, random);
    const AbsolutePose pose = estimator.Estimate(problem.camera, problem.matches);
    ASSERT_TRUE(pose.found);
    const auto error = PoseError(pose.pose.cam_from_world, problem.cam_from_world);
    sum += error.dot(pose.pose.covariance.ldlt().solve(error));
  }
  RecordProperty("nees", std::to_string(sum / kRuns));
  EXPECT_NEAR(sum / kRuns, 6, 0.8);
}

TEST(AbsolutePose, AGoodOrderSavesSamplesAndABadOneDoesNoHarm) {
  std::mt19937 random(4);
  AbsolutePoseEstimator estimator = Make();
  for (int i = 0; i < 20; ++i) {
    PoseProblem problem =
        MakePoseProblem(PinholeCamera(), {.num_matches = 400, .share_true = 0.2}, random);
    std::vector<PoseMatch> sorted[2];
    for (int k = 0; k < 400; ++k) sorted[problem.is_true[k]].push_back(problem.matches[k]);
    std::vector<PoseMatch> worst_first = sorted[0];
    worst_first.insert(worst_first.end(), sorted[1].begin(), sorted[1].end());
    EXPECT_TRUE(estimator.Estimate(problem.camera, worst_first).found);
    std::reverse(worst_first.begin(), worst_first.end());
    EXPECT_TRUE(estimator.Estimate(problem.camera, worst_first).found);
  }
}

TEST(AbsolutePose, WrongMatchesAloneAreNoPose) {
  std::mt19937 random(5);
  AbsolutePoseOptions options;
  options.min_inliers = 12;
  options.max_iterations = 2000;
  AbsolutePoseEstimator estimator = Make(options);
  for (int i = 0; i < 50; ++i) {
    const PoseProblem problem =
        MakePoseProblem(PinholeCamera(), {.num_matches = 200, .share_true = 0}, random);
    const AbsolutePose pose = estimator.Estimate(problem.camera, problem.matches);
    EXPECT_FALSE(pose.found);
    EXPECT_EQ(pose.num_iterations, options.max_iterations);
    const auto mask = estimator.inliers();
    EXPECT_EQ(std::count(mask.begin(), mask.end(), 0), 200);
  }
}

TEST(AbsolutePose, IsDeterministicAndKeepsNothingBetweenFrames) {
  std::mt19937 random(6);
  const PoseProblem a = MakePoseProblem(PinholeCamera(), {.share_true = 0.5}, random);
  const PoseProblem b = MakePoseProblem(TestCameras()[4], {.num_matches = 50}, random);
  AbsolutePoseEstimator estimator = Make();
  const AbsolutePose first = estimator.Estimate(a.camera, a.matches);
  (void)estimator.Estimate(b.camera, b.matches);
  const AbsolutePose again = estimator.Estimate(a.camera, a.matches);
  EXPECT_EQ(first.pose.cam_from_world.translation, again.pose.cam_from_world.translation);
  EXPECT_EQ(first.pose.covariance, again.pose.covariance);
  EXPECT_EQ(first.num_iterations, again.num_iterations);
}

TEST(AbsolutePose, HostileMatchesAreNoPose) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  std::mt19937 random(7);
  AbsolutePoseEstimator estimator = Make({.max_iterations = 200});
  const PoseProblem good = MakePoseProblem(PinholeCamera(), {.num_matches = 40}, random);
  const auto found = [&](auto change) {
    PoseProblem problem = good;
    for (std::size_t i = 0; i < problem.matches.size(); ++i) change(problem.matches[i], i);
    return estimator.Estimate(problem.camera, problem.matches).found;
  };
  EXPECT_TRUE(found([](PoseMatch&, std::size_t) {}));
  EXPECT_TRUE(found([](PoseMatch& m, std::size_t i) {
    if (i % 4 == 0) m.point_in_world.x() = kNan;
  }));
  EXPECT_FALSE(found([](PoseMatch& m, std::size_t) { m.point_in_world.x() = kNan; }));
  EXPECT_FALSE(found([](PoseMatch& m, std::size_t) { m.pixel.x() = kNan; }));
  EXPECT_FALSE(found([](PoseMatch& m, std::size_t) { m.sigma_px = 0; }));
  EXPECT_FALSE(found([](PoseMatch& m, std::size_t) { m.point_in_world.setOnes(); }));
  EXPECT_FALSE(found([](PoseMatch& m, std::size_t i) {
    m.point_in_world = Eigen::Vector3d(1, 2, 3) * static_cast<double>(i);
  }));
  EXPECT_FALSE(found([](PoseMatch& m, std::size_t) { m.pixel.setZero(); }));
  EXPECT_FALSE(estimator.Estimate(good.camera, {}).found);
}

TEST(AbsolutePose, MatchesBeyondTheCapacityAreLeftOut) {
  std::mt19937 random(8);
  AbsolutePoseEstimator estimator = Make({.capacity = 50});
  const PoseProblem problem = MakePoseProblem(PinholeCamera(), {.num_matches = 90}, random);
  const AbsolutePose pose = estimator.Estimate(problem.camera, problem.matches);
  EXPECT_TRUE(pose.found);
  EXPECT_EQ(estimator.inliers().size(), 50);
  EXPECT_LE(pose.num_inliers, 50);
}

TEST(AbsolutePose, OptionsAreChecked) {
  const auto code = [](const AbsolutePoseOptions& options) {
    return AbsolutePoseEstimator::Create(options).status().code();
  };
  EXPECT_EQ(code({.capacity = 2}), StatusCode::kInvalidArgument);
  EXPECT_EQ(code({.max_error_sigma = 0}), StatusCode::kInvalidArgument);
  EXPECT_EQ(code({.min_inliers = 3}), StatusCode::kInvalidArgument);
  EXPECT_EQ(code({.min_iterations = 10, .max_iterations = 9}), StatusCode::kInvalidArgument);
  EXPECT_EQ(code({.max_failure_probability = 1}), StatusCode::kInvalidArgument);
  EXPECT_EQ(code({.refiner = {.max_iterations = 0}}), StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace viewfix
