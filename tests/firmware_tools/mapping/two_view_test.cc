// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/two_view.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>

#include "platform/file.h"
#include "tests/firmware_tools/mapping/synthetic_scene.h"
#include "tests/testing/temp_folder.h"

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

void ExpectSame(const std::vector<VerifiedPair>& a, const std::vector<VerifiedPair>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].frames, b[i].frames);
    EXPECT_EQ(a[i].second_from_first.rotation.coeffs(), b[i].second_from_first.rotation.coeffs());
    EXPECT_EQ(a[i].second_from_first.translation, b[i].second_from_first.translation);
    EXPECT_EQ(a[i].median_angle_deg, b[i].median_angle_deg);
    ASSERT_EQ(a[i].matches.size(), b[i].matches.size());
    for (std::size_t m = 0; m < a[i].matches.size(); ++m) {
      EXPECT_EQ(a[i].matches[m].first_idx, b[i].matches[m].first_idx);
      EXPECT_EQ(a[i].matches[m].second_idx, b[i].matches[m].second_idx);
      EXPECT_EQ(a[i].matches[m].distance2, b[i].matches[m].distance2);
    }
  }
}

class KeptPairsTest : public ::testing::Test {
 protected:
  // All pairs of the input, with the folder as it stands; says how many it knew.
  std::string Report(const MapInput& input, const TwoViewOptions& options = {}) {
    const auto pairs = AllPairs(static_cast<int>(input.frames.size()));
    StageCache cache(folder_ / "stages");
    ExpectSame(VerifyPairs(input, pairs, options, 2, {}, &cache),
               VerifyPairs(input, pairs, options, 2));
    return cache.Report().at(0);
  }

  TempFolder folder_;
  SyntheticScene scene_{{.num_frames = 5}};
  SyntheticScene elsewhere_{{.num_frames = 1, .seed = 2}};
};

TEST_F(KeptPairsTest, ASecondRunTakesThemAll) {
  MapInput input = scene_.WithoutPoses();
  input.frames.push_back(elsewhere_.WithoutPoses().frames[0]);
  EXPECT_EQ(Report(input), "pairs: 0 of 15 kept");
  EXPECT_EQ(Report(input), "pairs: 15 of 15 kept") << "those that were refused too";
}

TEST_F(KeptPairsTest, AFrameBetweenTheOthersChangesNoneOfTheirPairs) {
  MapInput input = scene_.WithoutPoses();
  const MapFrame added = input.frames[2];
  input.frames.erase(input.frames.begin() + 2);
  EXPECT_EQ(Report(input), "pairs: 0 of 6 kept");
  input.frames.insert(input.frames.begin() + 2, added);
  EXPECT_EQ(Report(input), "pairs: 6 of 10 kept");
}

TEST_F(KeptPairsTest, WhatDecidesAPairIsLookedAt) {
  MapInput input = scene_.WithoutPoses();
  Report(input);
  for (const TwoViewOptions& other :
       {TwoViewOptions{.max_ratio = 0.7F}, TwoViewOptions{.max_error_px = 1},
        TwoViewOptions{.max_error_known_px = 2}, TwoViewOptions{.min_inliers = 20},
        TwoViewOptions{.seed = 2}}) {
    EXPECT_EQ(Report(input, other), "pairs: 0 of 10 kept");
  }
  input.cameras[0].fx += 1;
  EXPECT_EQ(Report(input), "pairs: 0 of 10 kept");
  EXPECT_EQ(Report(scene_.input), "pairs: 0 of 10 kept") << "there are poses now";
  EXPECT_EQ(Report(scene_.input), "pairs: 10 of 10 kept");
  scene_.input.frames[3].cam_from_world->translation.x() += 0.01;
  EXPECT_EQ(Report(scene_.input), "pairs: 6 of 10 kept");
  scene_.features[3]->keypoints[0].x += 1;
  EXPECT_EQ(Report(scene_.input), "pairs: 6 of 10 kept");
  scene_.features[3]->descriptors[0] ^= 1;
  EXPECT_EQ(Report(scene_.input), "pairs: 6 of 10 kept");
}

// The sum is right, the contents would lead beyond the frames' key points.
TEST_F(KeptPairsTest, MatchesOfKeypointsThatAreNotThereAreComputedAgain) {
  const MapInput input = scene_.WithoutPoses();
  ASSERT_EQ(Report(input), "pairs: 0 of 10 kept");
  const std::filesystem::path folder = folder_ / "stages";
  // Where a pair's matches stand: behind the sum, the angle, the motion and their number.
  constexpr std::size_t kFirstMatch = 32 + 8 + 7 * 8 + 8;
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) files.push_back(entry);
  for (const std::filesystem::path& file : files) {
    auto bytes = *ReadFile(file.string());
    ASSERT_GT(bytes.size(), kFirstMatch);
    bytes[kFirstMatch + 3] = 0x7F;
    Hash256 key;
    const std::string name = file.filename().string();
    ASSERT_EQ(
        sodium_hex2bin(key.data(), key.size(), name.data(), name.size(), nullptr, nullptr, nullptr),
        0);
    ContentHash sum;
    sum.AddAll(std::span<const std::uint8_t>(key));
    sum.AddAll(std::span<const std::uint8_t>(bytes).subspan(32));
    std::ranges::copy(sum.Result(), bytes.begin());
    ASSERT_TRUE(WriteFileAtomically(file.string(), bytes).ok());
  }
  EXPECT_EQ(Report(input), "pairs: 0 of 10 kept");
  EXPECT_EQ(Report(input), "pairs: 10 of 10 kept");
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
