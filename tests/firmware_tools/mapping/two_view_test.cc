// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/two_view.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/firmware_tools/mapping/synthetic_scene.h"

namespace viewfix {
namespace {

std::vector<FramePair> AllPairs(int num_frames) {
  std::vector<FramePair> pairs;
  for (int a = 0; a < num_frames; ++a) {
    for (int b = a + 1; b < num_frames; ++b) pairs.push_back({a, b});
  }
  return pairs;
}

double ShareRight(const SyntheticScene& scene, const VerifiedPair& pair) {
  int right = 0;
  for (const FeatureMatch& match : pair.matches) {
    const int a = scene.point_of[pair.frames.first_idx][match.first_idx];
    right += a >= 0 && a == scene.point_of[pair.frames.second_idx][match.second_idx];
  }
  return right / double(pair.matches.size());
}

TEST(VerifyPairs, FindsTheMotionOfTheCamera) {
  const SyntheticScene scene({.num_frames = 5});
  const auto pairs = AllPairs(5);
  const auto verified = VerifyPairs(scene.WithoutPoses(), pairs, {}, 1);
  ASSERT_EQ(verified.size(), pairs.size());
  for (const VerifiedPair& pair : verified) {
    const Rigid3 expected = scene.cam_from_world[pair.frames.second_idx] *
                            Inverse(scene.cam_from_world[pair.frames.first_idx]);
    EXPECT_LT(pair.second_from_first.rotation.angularDistance(expected.rotation), 0.02);
    EXPECT_GT(pair.second_from_first.translation.dot(expected.translation.normalized()), 0.98);
    EXPECT_GT(ShareRight(scene, pair), 0.99);
    EXPECT_GT(pair.median_angle_deg, 3);
  }
}

TEST(VerifyPairs, GivenPosesDecide) {
  SyntheticScene scene({.num_frames = 4});
  const auto pairs = AllPairs(4);
  for (const VerifiedPair& pair : VerifyPairs(scene.input, pairs, {}, 1)) {
    EXPECT_GT(ShareRight(scene, pair), 0.99);
  }
  // A wrong pose: what matched agrees no longer.
  scene.input.frames[3].cam_from_world->rotation =
      Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitX()) *
      scene.input.frames[3].cam_from_world->rotation;
  for (const VerifiedPair& pair : VerifyPairs(scene.input, pairs, {}, 1)) {
    EXPECT_NE(pair.frames.second_idx, 3);
  }
}

TEST(VerifyPairs, RefusesFramesOfDifferentPlaces) {
  const SyntheticScene one({.num_frames = 2, .seed = 1});
  const SyntheticScene other({.num_frames = 2, .seed = 2});
  MapInput both = one.WithoutPoses();
  both.frames.push_back(other.WithoutPoses().frames[0]);
  EXPECT_THAT(VerifyPairs(both, std::vector<FramePair>{{0, 2}, {1, 2}}, {}, 1),
              ::testing::IsEmpty());
}

TEST(VerifyPairs, IsTheSameOnAnyNumberOfThreads) {
  const SyntheticScene scene({.num_frames = 6, .noise_px = 1});
  const auto pairs = AllPairs(6);
  const auto one = VerifyPairs(scene.WithoutPoses(), pairs, {}, 1);
  const auto three = VerifyPairs(scene.WithoutPoses(), pairs, {}, 3);
  ASSERT_EQ(one.size(), three.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].matches.size(), three[i].matches.size());
    EXPECT_EQ(one[i].second_from_first.translation, three[i].second_from_first.translation);
  }
}

TEST(EpipolarError, IsTheAngleOffTheLine) {
  const Rigid3 motion{Eigen::Quaterniond::Identity(), {1, 0, 0}};
  const Eigen::Vector3d point(0.3, 0.2, 4);
  const Eigen::Vector3d first = point.normalized();
  const Eigen::Vector3d second = (motion * point).normalized();
  EXPECT_NEAR(EpipolarError(motion, first, second), 0, 1e-12);
  const Eigen::Vector3d off = Eigen::AngleAxisd(0.001, Eigen::Vector3d::UnitX()) * second;
  // Sampson's error shares the displacement between both rays.
  EXPECT_NEAR(EpipolarError(motion, first, off), 0.001 / std::sqrt(2), 5e-5);
}

}  // namespace
}  // namespace viewfix
