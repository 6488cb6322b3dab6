// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "firmware_tools/simulation/random.h"
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

// What a wall is covered with, and the metres that one repeat of it takes.
struct Covering {
  TexturePtr texture;
  float width, height;
};

// How one building is built and furnished. Lengths in metres.
struct Fashion {
  explicit Fashion(Random& random);

  cv::Scalar sign_ground, sign_ink;  // of its own signs, 8-bit BGR
  float skirting;
  float door_width, door_height;
  float ceiling_repeat, floor_repeat;
  float lamp_length, lamp_width, lamp_pitch;
  int lamp_rows;
  bool lamps_along;  // the lamps' long side runs from the door to the back
  float pillar_radius;
  int pillar_faces;
  float table_height, table_leg, seat_height, seat_back;
  float shelf_depth, shelf_board;
  std::array<float, 7> vase;  // radii from foot to lip
};

// What all rooms of one building share: doors, pillars, floor, lamps, furniture
// and a stock of posters that hang more than once.
struct Building {
  explicit Building(std::uint64_t seed);

  Fashion fashion;
  TexturePtr plaster, wood, dark_wood, floor, ceiling, marble, metal, white, black, lamp;
  TexturePtr extinguisher, exit_sign, disc_light, disc_dark, rug;
  std::vector<TexturePtr> doors, posters, people, plants, wood_boxes;
  std::vector<Covering> coverings;  // of walls

 private:
  explicit Building(Random random);
};

// The ten locations, in the order of the visit.
const std::vector<std::string>& LocationNames();
// Rooms of the same building that are no location.
const std::vector<std::string>& DistractorNames();

// `name`: one of the above. The same seed and name give the same room; another seed gives a
// room of other size and plan, furnished otherwise.
Room FurnishRoom(const Building& building, const std::string& name, std::uint64_t seed);
// The same, lit, for rendering.
Room BuildRoom(const Building& building, const std::string& name, std::uint64_t seed);

}  // namespace viewfix::simulation
