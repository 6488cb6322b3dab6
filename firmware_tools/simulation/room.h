// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "firmware_tools/simulation/scene.h"

namespace viewfix::simulation {

// One of the three directions in which a location is photographed: the camera
// stands `nearest` to `farthest` metres in front of `target`, looking along
// (cos heading, sin heading, 0).
struct Approach {
  std::string view;
  Eigen::Vector3f target;
  float heading;
  float nearest, farthest;
};

// A furnished room. Its floor is z = 0, x runs 0..width, y 0..depth (the visitor
// enters at y = 0 and looks towards +y).
struct Room {
  std::string name;
  float width, depth, height;
  Scene scene;
  std::array<Approach, 3> approaches;  // left, middle, right
};

// What all rooms of one building share: doors, pillars, floor, lamps, furniture
// and a stock of posters that hang more than once.
struct Building {
  explicit Building(std::uint64_t seed);

  TexturePtr plaster, wood, dark_wood, floor, ceiling, marble, metal, white, black, lamp;
  TexturePtr extinguisher, exit_sign, disc_light, disc_dark, rug;
  std::vector<TexturePtr> doors, posters, people, plants, wood_boxes;
};

// The ten locations, in the order of the visit.
const std::vector<std::string>& LocationNames();
// Rooms of the same building that are no location.
const std::vector<std::string>& DistractorNames();

// `name`: one of the above. The same seed and name give the same room.
Room BuildRoom(const Building& building, const std::string& name, std::uint64_t seed);

}  // namespace viewfix::simulation
