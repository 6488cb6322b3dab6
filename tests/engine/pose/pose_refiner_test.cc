// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pose/pose_refiner.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <limits>

#include "engine/pose/reprojection.h"
#include "tests/engine/geometry/test_cameras.h"
#include "tests/engine/pose/pose_problem.h"

namespace viewfix {
namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;

TEST(Reprojection, JacobianIsTheNumericOne) {
  std::mt19937 random(1);
  for (const Camera& camera : TestCameras()) {
    const PoseProblem problem = MakePoseProblem(camera, {.num_matches = 50}, random);
    CameraState state = CameraState::From(problem.cam_from_world, 1.03);
    const auto residual_at = [&](const CameraState& s, const PoseMatch& match) {
      Eigen::Vector2d residual;
      EXPECT_TRUE(Reproject<7>(camera, s, s.world_from_cam.conjugate().toRotationMatrix(), match,
                               residual, nullptr));
      return residual;
    };
    const auto moved = [&](int parameter, double step) {
      CameraState s = state;
      if (parameter == 6) {
        s.focal_factor += step;
        return s;
      }
      return s.MovedBy(step * Vector6d::Unit(parameter));
    };
    for (const PoseMatch& match : problem.matches) {
      Eigen::Vector2d residual;
      Eigen::Matrix<double, 2, 7> jacobian;
      ASSERT_TRUE(Reproject<7>(camera, state, state.world_from_cam.conjugate().toRotationMatrix(),
                               match, residual, &jacobian));
      for (int p = 0; p < 7; ++p) {
        const Eigen::Vector2d numeric =
            (residual_at(moved(p, 1e-6), match) - residual_at(moved(p, -1e-6), match)) / 2e-6;
        EXPECT_LT((jacobian.col(p) - numeric).norm(), 1e-4 * (1 + numeric.norm())) << p;
      }
    }
  }
}

TEST(PoseRefiner, FindsTheTruthWithoutNoise) {
  std::mt19937 random(2);
  for (const Camera& camera : TestCameras()) {
    for (int i = 0; i < 20; ++i) {
      const PoseProblem problem = MakePoseProblem(camera, {.num_matches = 30, .noise = 0}, random);
      const Rigid3 start = Disturbed(problem.cam_from_world, 0.1, 0.03, random);
      const RefinedPose pose = RefinePose(camera, problem.matches, {}, start, {});
      ASSERT_TRUE(pose.found);
      EXPECT_LT(PoseError(pose.cam_from_world, problem.cam_from_world).norm(), 1e-6);
    }
  }
}

TEST(PoseRefiner, FindsTheFocalLength) {
  std::mt19937 random(3);
  PoseRefinerOptions options;
  options.refine_focal = true;
  for (const double factor : {0.8, 1.0, 1.25}) {
    const PoseProblem problem =
        MakePoseProblem(PinholeCamera(), {.num_matches = 200, .noise = 0.2}, random);
    Camera wrong = problem.camera;
    wrong.fx /= factor;
    wrong.fy /= factor;
    const Rigid3 start = Disturbed(problem.cam_from_world, 0.1, 0.03, random);
    const RefinedPose pose = RefinePose(wrong, problem.matches, {}, start, options);
    ASSERT_TRUE(pose.found);
    EXPECT_NEAR(pose.focal_factor, factor, 0.004);
    EXPECT_LT(PoseError(pose.cam_from_world, problem.cam_from_world).norm(), 0.05);
  }
}

TEST(PoseRefiner, FewWrongMatchesBendThePoseLittle) {
  std::mt19937 random(4);
  for (int i = 0; i < 20; ++i) {
    const PoseProblem problem =
        MakePoseProblem(PinholeCamera(), {.num_matches = 200, .share_true = 0.9}, random);
    const Rigid3 start = Disturbed(problem.cam_from_world, 0.05, 0.01, random);
    const RefinedPose pose = RefinePose(problem.camera, problem.matches, {}, start, {});
    ASSERT_TRUE(pose.found);
    EXPECT_LT(PoseError(pose.cam_from_world, problem.cam_from_world).norm(), 0.05);
  }
}

TEST(PoseRefiner, MatchesNotUsedDoNotCount) {
  std::mt19937 random(5);
  PoseProblem problem = MakePoseProblem(PinholeCamera(), {.num_matches = 60}, random);
  std::vector<std::uint8_t> used(60, 1);
  std::vector<PoseMatch> kept;
  for (int i = 0; i < 60; ++i) {
    used[i] = i % 3 != 0;
    if (used[i]) kept.push_back(problem.matches[i]);
    if (!used[i]) problem.matches[i].pixel.setConstant(-1e6);
  }
  const Rigid3 start = Disturbed(problem.cam_from_world, 0.05, 0.01, random);
  const RefinedPose masked = RefinePose(problem.camera, problem.matches, used, start, {});
  const RefinedPose alone = RefinePose(problem.camera, kept, {}, start, {});
  ASSERT_TRUE(masked.found);
  EXPECT_EQ(masked.cam_from_world.translation, alone.cam_from_world.translation);
  EXPECT_EQ(masked.num_seen, 40);
}

// The normalized error squared has the mean of chi squared: 6. Its own standard deviation over
// the runs is sqrt(12 / runs).
double MeanNormalizedError(const Camera& camera, const PoseRefinerOptions& options, int num_matches,
                           int runs) {
  std::mt19937 random(6);
  double sum = 0;
  for (int i = 0; i < runs; ++i) {
    const PoseProblem problem = MakePoseProblem(camera, {.num_matches = num_matches}, random);
    const RefinedPose pose =
        RefinePose(camera, problem.matches, {},
                   Disturbed(problem.cam_from_world, 0.02, 0.005, random), options);
    EXPECT_TRUE(pose.found);
    const Vector6d error = PoseError(pose.cam_from_world, problem.cam_from_world);
    sum += error.dot(pose.covariance.ldlt().solve(error));
  }
  return sum / runs;
}

TEST(PoseRefiner, CovarianceIsHonest) {
  const double pinhole = MeanNormalizedError(PinholeCamera(), {}, 60, 3000);
  const double fisheye = MeanNormalizedError(TestCameras()[4], {}, 60, 3000);
  const double focal = MeanNormalizedError(PinholeCamera(), {.refine_focal = true}, 60, 3000);
  RecordProperty("nees_pinhole", std::to_string(pinhole));
  RecordProperty("nees_fisheye", std::to_string(fisheye));
  RecordProperty("nees_focal", std::to_string(focal));
  EXPECT_NEAR(pinhole, 6, 0.35);
  EXPECT_NEAR(fisheye, 6, 0.35);
  EXPECT_NEAR(focal, 6, 0.35);
}

TEST(PoseRefiner, ResidualRmsTellsWhetherSigmasAreRight) {
  std::mt19937 random(7);
  const PoseProblem problem =
      MakePoseProblem(PinholeCamera(), {.num_matches = 1000, .noise = 0.5}, random);
  const RefinedPose pose =
      RefinePose(problem.camera, problem.matches, {}, problem.cam_from_world, {});
  EXPECT_NEAR(pose.residual_rms, 0.5, 0.03);
}

TEST(PoseRefiner, HostileInputIsNotFound) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  std::mt19937 random(8);
  const PoseProblem good = MakePoseProblem(PinholeCamera(), {.num_matches = 20}, random);
  const auto found = [&](auto change, Rigid3 start) {
    PoseProblem problem = good;
    for (PoseMatch& match : problem.matches) change(match);
    return RefinePose(problem.camera, problem.matches, {}, start, {}).found;
  };
  EXPECT_TRUE(found([](PoseMatch&) {}, good.cam_from_world));
  EXPECT_FALSE(found([](PoseMatch& m) { m.point_in_world.x() = kNan; }, good.cam_from_world));
  EXPECT_FALSE(found([](PoseMatch& m) { m.pixel.y() = kNan; }, good.cam_from_world));
  EXPECT_FALSE(found([](PoseMatch& m) { m.sigma_px = 0; }, good.cam_from_world));
  EXPECT_FALSE(found([](PoseMatch& m) { m.sigma_px = -1; }, good.cam_from_world));
  EXPECT_FALSE(found([](PoseMatch& m) { m.sigma_px = kNan; }, good.cam_from_world));
  EXPECT_FALSE(found([](PoseMatch& m) { m.point_in_world.setZero(); }, good.cam_from_world));
  Rigid3 behind = good.cam_from_world;
  behind.translation.z() -= 100;
  EXPECT_FALSE(found([](PoseMatch&) {}, behind));
  Rigid3 nowhere;
  nowhere.translation.x() = kNan;
  EXPECT_FALSE(found([](PoseMatch&) {}, nowhere));
  EXPECT_FALSE(RefinePose(good.camera, {}, {}, good.cam_from_world, {}).found);
}

TEST(PoseRefiner, OptionsAreChecked) {
  EXPECT_TRUE(PoseRefinerOptions{}.Validate().ok());
  EXPECT_FALSE(PoseRefinerOptions{.max_iterations = 0}.Validate().ok());
  EXPECT_FALSE(PoseRefinerOptions{.huber_sigma = 0}.Validate().ok());
  EXPECT_FALSE(PoseRefinerOptions{.focal_prior_sigma = -1}.Validate().ok());
}

}  // namespace
}  // namespace viewfix
