// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/pair_consistency.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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

}  // namespace
}  // namespace viewfix
