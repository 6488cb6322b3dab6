// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "firmware_tools/simulation/artwork.h"
#include "firmware_tools/simulation/random.h"
#include "firmware_tools/simulation/room.h"

namespace viewfix::simulation {

enum class Wall { kLeft, kBack, kRight, kFront };

TexturePtr Bake(const cv::Mat& image);

// Puts walls, pictures and furniture into a room. Positions along a wall are
// metres from its left end as seen from inside; heights are above the floor.
class RoomBuilder {
 public:
  RoomBuilder(const Building& the_building, Room& room, Random stream)
      : building(the_building), random(stream), room_(room) {}

  // Walls, floor, ceiling with lamps, skirting. `texture_width` and `_height`: metres that
  // one repeat of the wall texture covers.
  void Shell(TexturePtr walls, float texture_width, float texture_height, TexturePtr floor,
             float brightness = 1);
  // The part of the shell that all rooms have: doors, pillars, exit sign, extinguisher.
  void SharedArchitecture(int doors);

  // A flat thing on a wall, `centre` along it; framed panels stand off 4 cm.
  void Hang(Wall wall, float centre, float bottom, float width, float height, TexturePtr texture,
            float glow = 0);
  // A box standing on z0, turned by `yaw` about its centre. Null top: as the sides.
  void Box(Eigen::Vector3f centre_bottom, Eigen::Vector3f size, TexturePtr sides,
           TexturePtr top = nullptr, float yaw = 0, TexturePtr front = nullptr);
  void Cylinder(Eigen::Vector3f centre_bottom, float radius, float height, TexturePtr side,
                TexturePtr cap, int faces = 10);
  // A cut-out standing upright, as two crossed planes or one.
  void CutOut(Eigen::Vector3f centre_bottom, float width, float height, TexturePtr texture,
              bool crossed, float yaw = 0);
  void FloorPatch(float x, float y, float width, float depth, TexturePtr texture);

  void Table(float x, float y, float width, float depth, float height = 0.74f);
  void Chair(float x, float y, float yaw);
  void Bench(float x, float y, float width, float depth);
  void Pillar(float x, float y);
  void Rope(float x0, float y0, float x1, float y1);
  void Plinth(float x, float y, float height);
  void Vase(Eigen::Vector3f base, float scale);
  void Plant(float x, float y);
  // Boards with what `draw` draws on each, against a wall.
  void Shelf(Wall wall, float centre, float width, int boards, float board_height, float bottom,
             cv::Mat (*draw)(Random&));

  // Approaches with the sideward targets on the side walls.
  void StandardApproaches(float side_y, float side_heading, float near_side, float far_side,
                          float near_middle, float far_middle);

  Eigen::Vector3f OnWall(Wall wall, float along, float up, float out) const;
  float WallLength(Wall wall) const;
  TexturePtr Poster() {
    return building.posters[random.Below(static_cast<int>(building.posters.size()))];
  }

  const Building& building;
  Random random;

 private:
  struct Frame {
    Eigen::Vector3f origin, right, normal;
  };
  Frame WallFrame(Wall wall) const;

  Room& room_;
};

}  // namespace viewfix::simulation
