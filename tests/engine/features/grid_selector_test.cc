// SPDX-License-Identifier: BSD-3-Clause
#include "engine/features/grid_selector.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "tests/engine/image/test_image.h"

namespace viewfix {
namespace {

std::vector<Keypoint> RandomPoints(int count, int width, int height, std::uint64_t seed) {
  TestRandom random(seed);
  std::vector<Keypoint> points(count);
  for (Keypoint& point : points) {
    point.x = static_cast<float>(random.Below(width * 16)) / 16;
    point.y = static_cast<float>(random.Below(height * 16)) / 16;
    point.sigma = 2;
    point.response = static_cast<float>(1 + random.Below(50));  // many ties
  }
  return points;
}

std::vector<Keypoint> Select(GridSelector& selector, const std::vector<Keypoint>& points, int width,
                             int height, int capacity) {
  selector.Start(width, height);
  for (const Keypoint& point : points) selector.Add(point);
  FeatureSet selected(capacity, 1);
  selector.Select(selected);
  return {selected.keypoints().begin(), selected.keypoints().end()};
}

bool SamePoint(const Keypoint& a, const Keypoint& b) {
  return a.x == b.x && a.y == b.y && a.response == b.response;
}

TEST(GridSelector, KeepsAllWhereTheyAreFew) {
  GridSelector selector(640, 300);
  EXPECT_EQ(Select(selector, RandomPoints(200, 640, 480, 1), 640, 480, 300).size(), 200U);
}

TEST(GridSelector, KeepsAsManyAsAllowedOfMore) {
  GridSelector selector(640, 300);
  EXPECT_EQ(Select(selector, RandomPoints(3000, 640, 480, 2), 640, 480, 300).size(), 300U);
}

TEST(GridSelector, DoesNotDependOnTheOrderOfAdding) {
  GridSelector selector(640, 300);
  std::vector<Keypoint> points = RandomPoints(5000, 640, 480, 3);
  const auto forward = Select(selector, points, 640, 480, 300);
  std::reverse(points.begin(), points.end());
  const auto backward = Select(selector, points, 640, 480, 300);
  ASSERT_EQ(forward.size(), backward.size());
  for (std::size_t i = 0; i < forward.size(); ++i) {
    EXPECT_TRUE(SamePoint(forward[i], backward[i])) << i;
  }
}

TEST(GridSelector, KeepsTheStrongestOfAll) {
  GridSelector selector(640, 300);
  std::vector<Keypoint> points = RandomPoints(5000, 640, 480, 4);
  for (int i = 0; i < 30; ++i) points[i * 7].response = static_cast<float>(1000 + i);
  const auto selected = Select(selector, points, 640, 480, 300);
  EXPECT_EQ(std::ranges::count_if(selected, [](auto& p) { return p.response >= 1000; }), 30);
}

std::vector<Keypoint> SelectWithoutHopeless(GridSelector& selector,
                                            const std::vector<Keypoint>& points, int width,
                                            int height) {
  selector.Start(width, height);
  for (const Keypoint& point : points) {
    if (selector.MayChoose(point.response)) selector.Add(point);
  }
  FeatureSet selected(300, 1);
  selector.Select(selected);
  return {selected.keypoints().begin(), selected.keypoints().end()};
}

// Strong points that give way to stronger ones of their cell leave room for weak ones elsewhere.
TEST(GridSelector, PointsThatGaveWayKeepNoOthersOut) {
  GridSelector selector(640, 300);
  std::vector<Keypoint> points = RandomPoints(1000, 70, 70, 9);
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i].response = 1000 * static_cast<float>(i + 1);
  }
  const std::vector<Keypoint> weak = RandomPoints(3000, 640, 480, 10);
  points.insert(points.end(), weak.begin(), weak.end());
  const auto expected = Select(selector, points, 640, 480, 300);
  EXPECT_TRUE(
      std::ranges::equal(SelectWithoutHopeless(selector, points, 640, 480), expected, SamePoint));
}

TEST(GridSelector, TakesAnyResponse) {
  GridSelector selector(640, 300);
  std::vector<Keypoint> points = RandomPoints(4, 640, 480, 11);
  points[0].response = 0;
  points[1].response = -0.0F;
  points[2].response = -1;
  points[3].response = 1e-40F;
  EXPECT_EQ(SelectWithoutHopeless(selector, points, 640, 480).size(), 4U);
}

// Without points that cannot be chosen any more the choice is the same: of points all over the
// image, crowded in a few cells, and in an image so small that cells keep some for certain.
TEST(GridSelector, ChoosesTheSameWithoutWhatCannotBeChosen) {
  struct Case {
    int width, height, points_width, points_height;
    bool some_left_out;
  };
  for (const Case& c : {Case{640, 480, 640, 480, true}, Case{640, 480, 300, 200, true},
                        Case{640, 480, 70, 70, false}, Case{24, 16, 24, 16, false}}) {
    GridSelector selector(640, 300);
    std::vector<Keypoint> points = RandomPoints(5000, c.points_width, c.points_height, 7);
    TestRandom random(8);
    for (Keypoint& point : points) point.response = static_cast<float>(1 + random.Below(1 << 20));
    const auto expected = Select(selector, points, c.width, c.height, 300);
    EXPECT_TRUE(std::ranges::equal(SelectWithoutHopeless(selector, points, c.width, c.height),
                                   expected, SamePoint))
        << c.points_width;
    const auto hopeless = std::ranges::count_if(
        points, [&](const Keypoint& point) { return !selector.MayChoose(point.response); });
    EXPECT_EQ(hopeless > 1000, c.some_left_out) << c.points_width;
  }
}

TEST(GridSelector, GivesNoCellMoreThan64) {
  GridSelector selector(640, 400);                                     // cells of 79 pixels
  const std::vector<Keypoint> points = RandomPoints(3000, 70, 70, 5);  // within one of them
  EXPECT_EQ(Select(selector, points, 640, 480, 400).size(), 64U);
}

TEST(GridSelector, KeepsToTheMaximumWhereCellsAreMoreThanThat) {
  GridSelector selector(4096, 16);
  EXPECT_EQ(Select(selector, RandomPoints(3000, 4096, 2, 6), 4096, 2, 16).size(), 16U);
}

TEST(GridSelector, ListsCellsRowByRowAndTheStrongestFirstInside) {
  GridSelector selector(240, 90);  // cells of 72 pixels
  std::vector<Keypoint> points(4);
  points[0].x = 200, points[0].y = 200, points[0].response = 9;
  points[1].x = 5, points[1].y = 5, points[1].response = 1;
  points[2].x = 8, points[2].y = 8, points[2].response = 2;
  points[3].x = 200, points[3].y = 5, points[3].response = 5;
  const auto selected = Select(selector, points, 240, 240, 90);
  ASSERT_EQ(selected.size(), 4U);
  EXPECT_TRUE(SamePoint(selected[0], points[2]));
  EXPECT_TRUE(SamePoint(selected[1], points[1]));
  EXPECT_TRUE(SamePoint(selected[2], points[3]));
  EXPECT_TRUE(SamePoint(selected[3], points[0]));
}

TEST(GridSelector, TakesPointsOutsideTheImage) {
  GridSelector selector(100, 16);
  std::vector<Keypoint> points(2);
  points[0].x = -0.4F, points[0].y = -0.4F, points[0].response = 1;
  points[1].x = 99.4F, points[1].y = 99.4F, points[1].response = 1;
  EXPECT_EQ(Select(selector, points, 100, 100, 16).size(), 2U);
}

}  // namespace
}  // namespace viewfix
