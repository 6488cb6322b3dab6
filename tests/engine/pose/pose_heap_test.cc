// SPDX-License-Identifier: BSD-3-Clause
// Nothing of engine/pose allocates after construction.
#include <gtest/gtest.h>

#include "engine/pose/absolute_pose.h"
#include "engine/pose/window_adjuster.h"
#include "tests/engine/geometry/test_cameras.h"
#include "tests/engine/pose/pose_problem.h"
#include "tests/testing/allocation_counter.h"

namespace viewfix {
namespace {

TEST(PoseHeap, EstimationRefinementAndWindowAllocateNothing) {
  std::mt19937 random(1);
  const PoseProblemOptions options{.num_matches = 300, .share_true = 0.5};
  auto estimator = AbsolutePoseEstimator::Create({});
  auto window = WindowAdjuster::Create({});
  PoseRefinerOptions with_focal;
  with_focal.refine_focal = true;
  double time_s = 0;
  for (const Camera& camera : TestCameras()) {
    const PoseProblem problem = MakePoseProblem(camera, options, random);
    const int before = AllocationsSoFar();
    const AbsolutePose pose = estimator->Estimate(camera, problem.matches);
    const bool refined = RefinePose(camera, problem.matches, estimator->inliers(),
                                    pose.pose.cam_from_world, with_focal)
                             .found;
    const bool adjusted =
        window->Push(time_s += 0.1, camera, problem.matches, pose.pose.cam_from_world).found;
    EXPECT_EQ(AllocationsSoFar(), before);
    EXPECT_TRUE(pose.found && refined && adjusted);
  }
}

}  // namespace
}  // namespace viewfix
