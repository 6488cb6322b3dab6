// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/simulation/room.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "firmware_tools/dataset/image_set.h"

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

TEST(BuildRoom, TheSameSeedGivesTheSameRoom) {
  const Building building(5);
  const Building again(5);
  EXPECT_EQ(Colours(BuildRoom(building, "hallway", 5)), Colours(BuildRoom(again, "hallway", 5)));
}

TEST(BuildRoom, AnotherSeedIsAnotherRoom) {
  const Building building(5);
  EXPECT_NE(Colours(BuildRoom(building, "hallway", 5)), Colours(BuildRoom(building, "hallway", 6)));
}

TEST(BuildRoom, ANameThatIsNoRoomIsAnError) {
  const Building building(5);
  EXPECT_THROW(BuildRoom(building, "vault", 5), ToolError);
}

// A view is a line of places that lie inside the room and see its target unobstructed
// from the middle of the line, so that there is something to photograph.
class EveryRoom : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryRoom, ApproachesLieInsideAndSeeTheirTargets) {
  const Room room = BuildRoom(Building(5), GetParam(), 5);
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

INSTANTIATE_TEST_SUITE_P(Museum, EveryRoom, ::testing::ValuesIn([] {
                           std::vector<std::string> names = LocationNames();
                           names.insert(names.end(), DistractorNames().begin(),
                                        DistractorNames().end());
                           return names;
                         }()),
                         [](const auto& room_name) { return room_name.param; });

}  // namespace
}  // namespace viewfix::simulation
