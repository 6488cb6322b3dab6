// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/pair_selection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace viewfix {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

MapInput Frames(const std::vector<std::string>& captures) {
  MapInput input;
  for (const std::string& capture : captures) input.frames.emplace_back().capture = capture;
  return input;
}

Rigid3 Facing(double heading, const Eigen::Vector3d& center) {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(heading, Eigen::Vector3d::UnitY()));
  return {turn, -(turn * center)};
}

TEST(SelectPairs, TakesNeighboursInsideACapture) {
  const MapInput input = Frames({"a", "b", "a", "b", "a"});
  const auto pairs =
      SelectPairs(input, Eigen::MatrixXf::Zero(5, 5), {.window = 1, .neighbours = 0});
  EXPECT_THAT(pairs, ElementsAre(FramePair{0, 2}, FramePair{1, 3}, FramePair{2, 4}));
}

TEST(SelectPairs, AddsTheMostAlike) {
  Eigen::MatrixXf similarity = Eigen::MatrixXf::Zero(4, 4);
  similarity(0, 3) = similarity(3, 0) = 0.9F;
  similarity(1, 2) = similarity(2, 1) = 0.8F;
  const auto pairs =
      SelectPairs(Frames({"a", "b", "c", "d"}), similarity, {.window = 8, .neighbours = 1});
  EXPECT_THAT(pairs, ElementsAre(FramePair{0, 3}, FramePair{1, 2}));
}

TEST(SelectPairs, LeavesOutWhatPosesRuleOut) {
  MapInput input = Frames({"a", "b"});
  const Eigen::MatrixXf similarity = Eigen::MatrixXf::Ones(2, 2);
  const PairOptions options{.max_heading_deg = 90, .max_distance = 5};
  input.frames[0].cam_from_world = Facing(0, {0, 0, 0});
  input.frames[1].cam_from_world = Facing(0, {0, 0, 9});
  EXPECT_THAT(SelectPairs(input, similarity, options), IsEmpty());
  input.frames[1].cam_from_world = Facing(3, {1, 0, 0});
  EXPECT_THAT(SelectPairs(input, similarity, options), IsEmpty());
  input.frames[1].cam_from_world = Facing(1, {1, 0, 0});
  EXPECT_THAT(SelectPairs(input, similarity, options), ElementsAre(FramePair{0, 1}));
}

TEST(PairsBeside, LooksAroundWhatWasFoundAgain) {
  const MapInput input = Frames({"a", "a", "a", "a", "b", "b", "b"});
  const std::vector<FramePair> tried = {{0, 1}, {0, 4}, {1, 2}, {1, 5}, {2, 3}, {4, 5}, {5, 6}};
  const std::vector<VerifiedPair> verified = {{{0, 1}, {}, {}, 0}, {{1, 5}, {}, {}, 0}};
  const PairOptions options{.window = 1, .reach = 1};
  EXPECT_THAT(PairsBeside(input, verified, tried, options), testing::SizeIs(3));  // half of 7
  const std::vector<FramePair> more(20, FramePair{0, 4});
  EXPECT_THAT(PairsBeside(input, verified, more, options),
              ElementsAre(FramePair{0, 5}, FramePair{0, 6}, FramePair{1, 4}, FramePair{1, 5},
                          FramePair{1, 6}, FramePair{2, 4}, FramePair{2, 5}, FramePair{2, 6}));
}

TEST(PairsBeside, PairsInOrderBringNothingNew) {
  const MapInput input = Frames({"a", "a", "a", "a"});
  const std::vector<VerifiedPair> verified = {{{0, 1}, {}, {}, 0}};
  const std::vector<FramePair> tried(20, FramePair{0, 1});
  EXPECT_THAT(PairsBeside(input, verified, tried, {.window = 1, .reach = 1}), IsEmpty());
}

TEST(PairsBeside, MostMatchesFirst) {
  const MapInput input = Frames({"a", "b", "b", "c", "c"});
  const std::vector<VerifiedPair> verified = {{{0, 1}, std::vector<FeatureMatch>(10), {}, 0},
                                              {{0, 3}, std::vector<FeatureMatch>(20), {}, 0}};
  const std::vector<FramePair> tried = {{0, 1}, {0, 3}};
  EXPECT_THAT(PairsBeside(input, verified, tried, {.window = 1, .reach = 1}),
              ElementsAre(FramePair{0, 4}));
}

}  // namespace
}  // namespace viewfix
