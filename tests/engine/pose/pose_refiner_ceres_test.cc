// SPDX-License-Identifier: BSD-3-Clause
// The refiner beside all of Ceres on the same robust problem.
#include <gtest/gtest.h>

#include "tests/engine/geometry/test_cameras.h"
#include "tests/engine/pose/ceres_pose.h"

namespace viewfix {
namespace {

TEST(PoseRefinerCeres, FindsTheSameMinimum) {
  std::mt19937 random(1);
  for (const bool refine_focal : {false, true}) {
    for (int i = 0; i < 30; ++i) {
      const PoseProblem p =
          MakePoseProblem(PinholeCamera(), {.num_matches = 80, .share_true = 0.9}, random);
      const Rigid3 start = Disturbed(p.cam_from_world, 0.05, 0.01, random);
      const PoseRefinerOptions options{.max_iterations = 100, .refine_focal = refine_focal};
      const RefinedPose ours = RefinePose(p.camera, p.matches, {}, start, options);
      const CeresSolution theirs = SolveWithCeres(p, start, options, 1e-14);
      ASSERT_TRUE(theirs.usable);
      ASSERT_TRUE(ours.found);
      EXPECT_NEAR(ours.cost, theirs.cost, 1e-5 * theirs.cost);
      EXPECT_LT(PoseError(ours.cam_from_world, theirs.cam_from_world).norm(), 1e-4);
      EXPECT_NEAR(ours.focal_factor, theirs.focal_factor, 1e-4);
    }
  }
}

}  // namespace
}  // namespace viewfix
