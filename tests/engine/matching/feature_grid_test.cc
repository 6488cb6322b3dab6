// SPDX-License-Identifier: BSD-3-Clause
#include "engine/matching/feature_grid.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <limits>
#include <random>

namespace viewfix {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

std::vector<Keypoint> RandomKeypoints(int count, float from, float to, std::mt19937& random) {
  std::uniform_real_distribution<float> coordinate(from, to);
  std::vector<Keypoint> keypoints(count);
  for (Keypoint& k : keypoints) k.x = coordinate(random), k.y = coordinate(random);
  return keypoints;
}

std::vector<int> Visited(const FeatureGrid& grid, double x, double y, double radius) {
  std::vector<int> visited;
  grid.ForEachNear(x, y, radius, [&](int i) { visited.push_back(i); });
  return visited;
}

void ExpectAllNear(const FeatureGrid& grid, std::span<const Keypoint> keypoints, double x, double y,
                   double radius) {
  std::vector<int> visited = Visited(grid, x, y, radius);
  std::sort(visited.begin(), visited.end());
  EXPECT_EQ(std::adjacent_find(visited.begin(), visited.end()), visited.end()) << "visited twice";
  for (int i = 0; i < static_cast<int>(keypoints.size()); ++i) {
    const double dx = double{keypoints[i].x} - x;
    const double dy = double{keypoints[i].y} - y;
    if (!(dx * dx + dy * dy <= radius * radius)) continue;
    EXPECT_TRUE(std::binary_search(visited.begin(), visited.end(), i)) << x << " " << y;
  }
}

TEST(FeatureGrid, MissesNoneThatBruteForceFinds) {
  std::mt19937 random(1);
  FeatureGrid grid(500);
  // Wider than the grid on every side, so that points and questions lie beyond its edge.
  std::uniform_real_distribution<double> coordinate(-200, 1400), radius(0, 60);
  for (int frame = 0; frame < 20; ++frame) {
    const auto keypoints = RandomKeypoints(500, -150, 1300, random);
    grid.Fill(keypoints);
    for (int q = 0; q < 100; ++q) {
      ExpectAllNear(grid, keypoints, coordinate(random), coordinate(random), radius(random));
    }
  }
}

TEST(FeatureGrid, VisitsFewOfManyInAFixedOrder) {
  std::mt19937 random(2);
  FeatureGrid grid(800);
  const auto keypoints = RandomKeypoints(800, 0, 640, random);
  grid.Fill(keypoints);
  const std::vector<int> visited = Visited(grid, 320, 320, 8);
  EXPECT_LT(visited.size(), 40U);
  EXPECT_EQ(Visited(grid, 320, 320, 8), visited);
  const std::vector<int> all = Visited(grid, 320, 320, 1e6);
  EXPECT_EQ(all.size(), 800U);
}

TEST(FeatureGrid, AFrameForgetsTheOneBefore) {
  std::mt19937 random(3);
  FeatureGrid grid(100);
  grid.Fill(RandomKeypoints(100, 0, 640, random));
  const auto few = RandomKeypoints(3, 0, 640, random);
  grid.Fill(few);
  EXPECT_THAT(Visited(grid, 320, 320, 1e4), testing::UnorderedElementsAre(0, 1, 2));
  grid.Fill({});
  EXPECT_THAT(Visited(grid, 320, 320, 1e4), testing::IsEmpty());
}

TEST(FeatureGrid, HostileCoordinatesAreLeftOutOrKeptInside) {
  FeatureGrid grid(8);
  std::vector<Keypoint> keypoints(8);
  const float values[] = {kNan, kInfinity, -kInfinity, 3e38F, -3e38F, -0.0F, 1e-45F, 16};
  for (int i = 0; i < 8; ++i) keypoints[i].x = values[i];
  grid.Fill(keypoints);
  EXPECT_THAT(Visited(grid, 0, 0, 1e39), testing::UnorderedElementsAre(3, 4, 5, 6, 7));
}

TEST(FeatureGrid, HostileQuestionsEnd) {
  std::mt19937 random(4);
  FeatureGrid grid(50);
  const auto keypoints = RandomKeypoints(50, 0, 640, random);
  grid.Fill(keypoints);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double x : {nan, infinity, -infinity, 1e300, -1e300}) {
    EXPECT_LE(Visited(grid, x, x, 8).size(), 50U);
    EXPECT_LE(Visited(grid, 8, 8, x).size(), 50U);
  }
}

TEST(FeatureGrid, MoreThanItsCapacityAreCut) {
  std::mt19937 random(5);
  FeatureGrid grid(10);
  grid.Fill(RandomKeypoints(30, 0, 640, random));
  EXPECT_EQ(Visited(grid, 320, 320, 1e4).size(), 10U);
}

}  // namespace
}  // namespace viewfix
