// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>

#include "firmware_tools/simulation/artwork.h"
#include "firmware_tools/simulation/random.h"
#include "firmware_tools/simulation/room.h"

namespace viewfix::simulation {

enum class Wall { kLeft, kBack, kRight, kFront };

TexturePtr Bake(const cv::Mat& image);

// A wall's covering of drawn material and colour.
Covering DrawCovering(Random& random);

// Something that takes `width` metres of a wall; `put` puts it up, its middle `along` the wall.
struct WallThing {
  float width;
  std::function<void(Wall wall, float along)> put;
};

// Puts walls, pictures and furniture into a room. Positions along a wall are
// metres from its left end as seen from inside; heights are above the floor.
class RoomBuilder {
 public:
  // `own_stream` draws what things show, `layout_stream` where they stand and how large they
  // are: rooms of equal layout streams are look-alikes.
  RoomBuilder(const Building& the_building, Room& room, Random own_stream, Random layout_stream)
      : building(the_building), random(own_stream), layout(layout_stream), room_(room) {}

  float width() const { return room_.width; }
  float depth() const { return room_.depth; }
  float height() const { return room_.height; }

  // From the layout's stream.
  float Draw(double low, double high) { return static_cast<float>(layout.Uniform(low, high)); }
  int Count(int least, int most) { return least + layout.Below(most - least + 1); }

  // Where the room is photographed from, drawn: ahead, and to either side at about
  // `side_heading` radians. First of all, so that the furniture leaves these lines free.
  void Approaches(float side_heading = 0.78f);

  // Walls, floor, ceiling with lamps, skirting.
  void Shell(const Covering& walls, const TexturePtr& floor, float brightness = 1);

  // A flat thing on a wall, `centre` along it; framed panels stand off 4 cm.
  void Hang(Wall wall, float centre, float bottom, float width, float height, TexturePtr texture,
            float glow = 0);
  // A sign of the building under the ceiling, above all that Picture hangs; `widest` metres at
  // most, all of the wall if 0.
  void Sign(Wall wall, float centre, const std::string& text, float widest = 0);
  // A box standing on z0, turned by `yaw` about its centre. Null top: as the sides.
  void Box(Eigen::Vector3f centre_bottom, Eigen::Vector3f size, TexturePtr sides,
           TexturePtr top = nullptr, float yaw = 0, TexturePtr front = nullptr);
  void Cylinder(Eigen::Vector3f centre_bottom, float radius, float height, TexturePtr side,
                TexturePtr cap, int faces = 10);
  // A cut-out standing upright, as two crossed planes or one.
  void CutOut(Eigen::Vector3f centre_bottom, float width, float height, TexturePtr texture,
              bool crossed, float yaw = 0);
  void FloorPatch(float x, float y, float width, float depth, TexturePtr texture);

  void Table(float x, float y, float width, float depth);
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

  // Wall things, their sizes drawn around those given.
  WallThing Picture(float width, float height, float bottom, TexturePtr texture, float glow = 0);
  WallThing Poster();
  WallThing Door();
  WallThing Extinguisher();
  WallThing Shelves(float width, int boards, float board_height, cv::Mat (*draw)(Random&));

  // Puts things side by side between `from` and `to`, in drawn order with drawn gaps. What does
  // not fit beside those before it in `things` is left away.
  void Spread(Wall wall, float from, float to, std::vector<WallThing> things);
  // Things and `posters` on the back wall.
  void SpreadBack(std::vector<WallThing> things, int posters);
  // Deals things and the doors and posters that all rooms have to the walls left and right.
  void SpreadSides(std::vector<WallThing> things);

  // Up to `count` things that take `width` x `depth` of the floor, wherever in the part of the
  // room that is in sight they stand in nobody's way.
  void Scatter(int count, float width, float depth,
               const std::function<void(float x, float y)>& put);
  // Scatter keeps off this part of the floor.
  void Occupy(float x, float y, float width, float depth);

  Eigen::Vector3f OnWall(Wall wall, float along, float up, float out) const;
  float WallLength(Wall wall) const;
  TexturePtr StockPoster() { return Any(building.posters); }

  // Of `stock`, one drawn.
  template <typename T>
  const T& Any(const std::vector<T>& stock) {
    return stock[random.Below(static_cast<int>(stock.size()))];
  }

  const Building& building;
  Random random;
  Random layout;

 private:
  struct Frame {
    Eigen::Vector3f origin, right, normal;
  };
  Frame WallFrame(Wall wall) const;
  void Lamps(float brightness);
  bool IsFree(const Eigen::AlignedBox2f& place) const;

  Room& room_;
  std::vector<Eigen::AlignedBox2f> occupied_;
};

}  // namespace viewfix::simulation
