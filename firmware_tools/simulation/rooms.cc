// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/simulation/rooms.h"

#include <functional>
#include <map>
#include <numbers>

#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/simulation/draw.h"

namespace viewfix::simulation {
namespace {

struct Plan {
  Eigen::Vector3f size;  // of the rooms on average, metres
  std::function<void(RoomBuilder&)> furnish;
  std::string layout = {};  // rooms of one name here are look-alikes; empty: the room's own
};

const std::map<std::string, Plan>& Plans() {
  static const std::map<std::string, Plan> plans{
      {"cafe", {{8, 8, 3.4f}, Cafe}},
      {"hallway", {{3.5f, 11.5f, 3.2f}, Hallway}},
      {"stairs", {{8, 8.4f, 3.8f}, Stairs}},
      {"lobby", {{9, 9, 3.7f}, Lobby}},
      {"show_window_1",
       {{8, 7.4f, 3.4f}, [](RoomBuilder& b) { ShowWindow(b, 1); }, "show windows"}},
      {"show_window_2",
       {{8, 7.4f, 3.4f}, [](RoomBuilder& b) { ShowWindow(b, 2); }, "show windows"}},
      {"book_shelf", {{7.4f, 7.4f, 3.3f}, BookShelf}},
      {"video_room", {{8, 7.6f, 3.4f}, VideoRoom}},
      {"special_room", {{8, 8, 3.4f}, SpecialRoom}},
      {"exhibit", {{8, 8, 3.4f}, Exhibit}},
      {"office", {{8, 8, 3.3f}, Office}},
      {"classroom", {{8, 8, 3.4f}, Classroom}},
      {"store", {{8, 8, 3.4f}, Store}},
      {"lockers", {{8, 8, 3.3f}, Lockers}},
      {"workshop", {{8, 8, 3.4f}, Workshop}}};
  return plans;
}

Room Mirrored(Room room) {
  room.scene = room.scene.Mirrored(room.width);
  std::swap(room.approaches[0], room.approaches[2]);
  std::swap(room.approaches[0].view, room.approaches[2].view);
  for (Approach& approach : room.approaches) {
    approach.target.x() = room.width - approach.target.x();
    approach.heading = static_cast<float>(std::numbers::pi) - approach.heading;
  }
  return room;
}

}  // namespace

Covering RoomWalls(RoomBuilder& b) {
  return b.random.Chance(0.6) ? DrawCovering(b.random) : b.Any(b.building.coverings);
}

TexturePtr RoomFloor(RoomBuilder& b) {
  const Building& s = b.building;
  if (b.random.Chance(0.25)) {
    return Bake(DrawCarpet(b.random, RandomColour(b.random, 20, 160, 60, 150)));
  }
  return b.Any(std::vector<TexturePtr>{s.floor, s.floor, s.wood, s.marble});
}

void OwnShell(RoomBuilder& b, float brightness) {
  const TexturePtr floor = RoomFloor(b);
  b.Shell(RoomWalls(b), floor, brightness);
}

std::string Capitals(std::string text) {
  for (char& c : text) {
    if (c >= 'a' && c <= 'z') c = static_cast<char>(c - 'a' + 'A');
  }
  return text;
}

const std::vector<std::string>& LocationNames() {
  static const std::vector<std::string> names{
      "cafe",          "hallway",    "stairs",     "lobby",        "show_window_1",
      "show_window_2", "book_shelf", "video_room", "special_room", "exhibit"};
  return names;
}

const std::vector<std::string>& DistractorNames() {
  static const std::vector<std::string> names{"office", "classroom", "store", "lockers",
                                              "workshop"};
  return names;
}

Room FurnishRoom(const Building& building, const std::string& name, std::uint64_t seed) {
  const auto plan = Plans().find(name);
  if (plan == Plans().end()) throw ToolError(name + ": no such room");
  const std::string& layout_name = plan->second.layout.empty() ? name : plan->second.layout;
  Random layout(seed, "layout of " + layout_name);
  Room room{name, 0, 0, 0, {}, {}};
  room.width = plan->second.size.x() * static_cast<float>(layout.Uniform(0.87, 1.2));
  room.depth = plan->second.size.y() * static_cast<float>(layout.Uniform(0.9, 1.2));
  room.height = plan->second.size.z() * static_cast<float>(layout.Uniform(0.92, 1.15));
  const bool mirrored = layout.Chance(0.5);
  RoomBuilder builder(building, room, Random(seed, name), layout);
  plan->second.furnish(builder);
  return mirrored ? Mirrored(std::move(room)) : room;
}

Room BuildRoom(const Building& building, const std::string& name, std::uint64_t seed) {
  Room room = FurnishRoom(building, name, seed);
  room.scene.BakeLight();
  return room;
}

}  // namespace viewfix::simulation
