// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/pair_consistency.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace viewfix {
namespace {

using ::testing::Contains;
using ::testing::Not;

// Frames of a walk that turns; pairs carry the true rotations unless a test spoils them.
class Graph {
 public:
  explicit Graph(int num_frames) {
    for (int f = 0; f < num_frames; ++f) {
      input.frames.emplace_back().capture = "walk";
      rotations_.emplace_back(Eigen::AngleAxisd(0.1 * f, Eigen::Vector3d(0.3, 1, 0).normalized()));
    }
  }

  void Add(int a, int b, int num_matches, double wrong_by = 0) {
    VerifiedPair pair{{a, b}, {}, {}, 5};
    for (int m = 0; m < num_matches; ++m) pair.matches.push_back({next_, next_, 0}), ++next_;
    pair.second_from_first.rotation = Eigen::AngleAxisd(wrong_by, Eigen::Vector3d::UnitX()) *
                                      rotations_[b] * rotations_[a].conjugate();
    pairs.push_back(std::move(pair));
  }

  std::vector<FramePair> Kept() const {
    std::vector<FramePair> kept;
    for (const VerifiedPair& pair : KeepConsistentPairs(input, pairs)) kept.push_back(pair.frames);
    return kept;
  }

  MapInput input;
  std::vector<VerifiedPair> pairs;

 private:
  std::vector<Eigen::Quaterniond> rotations_;
  int next_ = 0;
};

Graph Walk() {
  Graph graph(40);
  for (int a = 0; a < 40; ++a) {
    for (int b = a + 1; b < 40 && b <= a + 3; ++b) graph.Add(a, b, 50);
  }
  return graph;
}

TEST(KeepConsistentPairs, KeepsWhatAgrees) {
  Graph graph = Walk();
  graph.Add(2, 36, 40);
  graph.Add(2, 37, 40);
  graph.Add(3, 36, 40);
  graph.Add(3, 37, 40);
  EXPECT_EQ(graph.Kept().size(), graph.pairs.size());
}

TEST(KeepConsistentPairs, DropsAnEdgeAgainstTheMajority) {
  Graph graph = Walk();
  graph.Add(5, 9, 80, 1.0);
  EXPECT_THAT(graph.Kept(), Not(Contains(FramePair{5, 9})));
  EXPECT_EQ(graph.Kept().size(), graph.pairs.size() - 1);
}

TEST(KeepConsistentPairs, DropsALonePairOfFramesFarApart) {
  Graph graph = Walk();
  graph.Add(2, 36, 200);
  EXPECT_THAT(graph.Kept(), Not(Contains(FramePair{2, 36})));
}

// Few matches give a poor rotation; that they lead back to themselves is evidence of its own.
TEST(KeepConsistentPairs, KeepsUnsureRotationsWhoseKeyPointsReturn) {
  Graph graph = Walk();
  const auto add = [&](int a, int b, int first_key_point) {
    graph.Add(a, b, 0, 0.5);
    for (int m = 0; m < 20; ++m) {
      graph.pairs.back().matches.push_back({first_key_point + m, first_key_point + m, 0});
    }
  };
  // The key points of Walk()'s pairs 2-3 and 36-37.
  const auto of_pair = [&](int a, int b) {
    const auto same = [&](const VerifiedPair& pair) { return pair.frames == FramePair{a, b}; };
    return std::find_if(graph.pairs.begin(), graph.pairs.end(), same)->matches.front().first_idx;
  };
  add(2, 36, of_pair(2, 3));
  add(3, 36, of_pair(2, 3));
  EXPECT_THAT(graph.Kept(), Not(Contains(FramePair{2, 36})));  // one loop is not enough
  add(2, 37, of_pair(36, 37));
  graph.pairs.back().matches = graph.pairs[graph.pairs.size() - 3].matches;
  for (VerifiedPair& pair : graph.pairs) {
    if (pair.frames != FramePair{36, 37}) continue;
    pair.matches = graph.pairs.back().matches;
  }
  EXPECT_THAT(graph.Kept(), Contains(FramePair{2, 36}));
}

}  // namespace
}  // namespace viewfix
