// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/simulation/room.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/simulation/stand.h"

namespace viewfix::simulation {
namespace {

// What the camera would see of the room's materials, in the order they were put up.
std::vector<std::uint32_t> Colours(const Room& room) {
  std::vector<std::uint32_t> colours;
  for (const Quad& quad : room.scene.quads()) {
    colours.push_back(quad.texture->Sample(0.3f, 0.6f, 2));
    colours.push_back(quad.texture->Sample(0.7f, 0.2f, 2));
  }
  return colours;
}

// How far the room's surfaces are from one stand, all around it.
std::vector<float> DistancesSeen(const Room& room) {
  std::vector<float> distances;
  for (int i = 0; i < 32; ++i) {
    const Eigen::Vector3f ahead = Heading(2 * std::numbers::pi * i / 32);
    distances.push_back(room.scene.Distance({1.5f, 2.5f, 1.4f}, ahead, 20));
  }
  return distances;
}

TEST(BuildRoom, TheSameSeedGivesTheSameRoom) {
  const Building building(5);
  const Building again(5);
  EXPECT_EQ(Colours(BuildRoom(building, "hallway", 5)), Colours(BuildRoom(again, "hallway", 5)));
}

TEST(FurnishRoom, TheTwoShowWindowsAreLookAlikes) {
  const Building building(5);
  const Room one = FurnishRoom(building, "show_window_1", 5);
  const Room two = FurnishRoom(building, "show_window_2", 5);
  EXPECT_EQ(one.width, two.width);
  EXPECT_EQ(one.scene.quads().size(), two.scene.quads().size());
  EXPECT_EQ(DistancesSeen(one), DistancesSeen(two));
  EXPECT_NE(Colours(one), Colours(two));
}

TEST(Scene, AMirroredSceneIsSeenFromTheOtherSide) {
  const Room room = FurnishRoom(Building(5), "exhibit", 5);
  const Scene mirrored = room.scene.Mirrored(room.width);
  for (int i = 0; i < 32; ++i) {
    const Eigen::Vector3f there = Heading(0.2 * i);
    const Eigen::Vector3f back(-there.x(), there.y(), there.z());
    EXPECT_NEAR(room.scene.Distance({2, 3, 1.5f}, there, 20),
                mirrored.Distance({room.width - 2, 3, 1.5f}, back, 20), 1e-4f);
  }
}

TEST(BuildRoom, ANameThatIsNoRoomIsAnError) {
  const Building building(5);
  EXPECT_THROW(BuildRoom(building, "vault", 5), ToolError);
}

std::vector<std::string> RoomNames() {
  std::vector<std::string> names = LocationNames();
  names.insert(names.end(), DistractorNames().begin(), DistractorNames().end());
  return names;
}

// FreeStand throws where there is none.
TEST(FurnishRoom, OfAnySeedHasFreeStands) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const Building building(seed);
    for (const std::string& name : RoomNames()) {
      const Room room = FurnishRoom(building, name, seed);
      Random random(seed, name);
      for (const Approach& approach : room.approaches) {
        for (const float distance : {approach.nearest, approach.farthest}) {
          EXPECT_NO_THROW(FreeStand(room, approach, double{distance}, random)) << "seed " << seed;
        }
      }
    }
  }
}

// A view is a line of places that lie inside the room and see its target unobstructed
// from the middle of the line, so that there is something to photograph.
class EveryRoom : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryRoom, ApproachesLieInsideAndSeeTheirTargets) {
  const Room room = FurnishRoom(Building(5), GetParam(), 5);
  const char* names[] = {"left", "middle", "right"};
  for (int i = 0; i < 3; ++i) {
    const Approach& approach = room.approaches[i];
    EXPECT_EQ(approach.view, names[i]);
    const Eigen::Vector3f along(std::cos(approach.heading), std::sin(approach.heading), 0);
    for (const float distance : {approach.nearest, approach.farthest}) {
      const Eigen::Vector3f at = approach.target - distance * along;
      EXPECT_GT(at.minCoeff(), 0) << approach.view << " at " << distance;
      EXPECT_LT(at.x(), room.width) << approach.view << " at " << distance;
      EXPECT_LT(at.y(), room.depth) << approach.view << " at " << distance;
    }
    const float middle = 0.5f * (approach.nearest + approach.farthest);
    EXPECT_GT(room.scene.Distance(approach.target - middle * along, along, 20), 0.5f * middle);
  }
}

// Not the same place with other pictures on its walls.
TEST_P(EveryRoom, OfAnotherSeedIsAnotherPlace) {
  const Room room = FurnishRoom(Building(5), GetParam(), 5);
  const std::vector<float> distances = DistancesSeen(room);
  for (const std::uint64_t seed : {6, 7, 8}) {
    const Room other = FurnishRoom(Building(seed), GetParam(), seed);
    EXPECT_NE(Colours(room), Colours(other)) << seed;
    EXPECT_GT(std::abs(room.width - other.width) + std::abs(room.depth - other.depth), 0.1f);
    const std::vector<float> others = DistancesSeen(other);
    int equal = 0;
    for (std::size_t i = 0; i < distances.size(); ++i) {
      equal += std::abs(distances[i] - others[i]) < 0.02f ? 1 : 0;
    }
    // The stand is as far from the left and the front wall in every room.
    EXPECT_LE(equal, 22) << seed;
  }
}

TEST_P(EveryRoom, IsLitThroughout) {
  const Room room = BuildRoom(Building(5), GetParam(), 5);
  ASSERT_EQ(room.scene.light_maps().size(), room.scene.quads().size());
  float lamps = 0;
  for (const LightMap& map : room.scene.light_maps()) {
    ASSERT_EQ(map.light.size(), static_cast<std::size_t>(map.nodes_u * map.nodes_v));
    for (const Eigen::Vector2f& light : map.light) {
      EXPECT_GE(light.x(), 0);
      EXPECT_LE(light.x(), 1.0001f);
      EXPECT_GE(light.y(), 0);
      lamps = std::max(lamps, light.y());
    }
  }
  EXPECT_GT(lamps, 0.1f);
}

INSTANTIATE_TEST_SUITE_P(Museum, EveryRoom, ::testing::ValuesIn(RoomNames()),
                         [](const auto& room_name) { return room_name.param; });

}  // namespace
}  // namespace viewfix::simulation
