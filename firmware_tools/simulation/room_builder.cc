// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/simulation/room_builder.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace viewfix::simulation {
namespace {

using Eigen::Vector3f;

const Vector3f kUp = Vector3f::UnitZ();
constexpr float kSigns = 0.58f;   // metres under the ceiling that are left to signs
constexpr float kCorner = 0.45f;  // of a side wall, that the back wall's shelves may hide

// A quad that repeats its texture every (width, height) metres.
Quad Tiled(Vector3f corner, Vector3f right, Vector3f down, TexturePtr texture, float width,
           float height) {
  Quad quad{corner, right, down, std::move(texture)};
  quad.repeat_u = right.norm() / width;
  quad.repeat_v = down.norm() / height;
  return quad;
}

}  // namespace

TexturePtr Bake(const cv::Mat& image) { return std::make_shared<Texture>(image); }

RoomBuilder::Frame RoomBuilder::WallFrame(Wall wall) const {
  switch (wall) {
    case Wall::kLeft:
      return {{0, 0, 0}, Vector3f::UnitY(), Vector3f::UnitX()};
    case Wall::kBack:
      return {{0, room_.depth, 0}, Vector3f::UnitX(), -Vector3f::UnitY()};
    case Wall::kRight:
      return {{room_.width, room_.depth, 0}, -Vector3f::UnitY(), -Vector3f::UnitX()};
    default:
      return {{room_.width, 0, 0}, -Vector3f::UnitX(), Vector3f::UnitY()};
  }
}

float RoomBuilder::WallLength(Wall wall) const {
  return wall == Wall::kLeft || wall == Wall::kRight ? room_.depth : room_.width;
}

Vector3f RoomBuilder::OnWall(Wall wall, float along, float up, float out) const {
  const Frame frame = WallFrame(wall);
  return frame.origin + along * frame.right + up * kUp + out * frame.normal;
}

void RoomBuilder::Shell(const Covering& walls, const TexturePtr& floor, float brightness) {
  const float w = room_.width, d = room_.depth, h = room_.height;
  const Fashion& fashion = building.fashion;
  for (const Wall wall : {Wall::kLeft, Wall::kBack, Wall::kRight, Wall::kFront}) {
    const Frame frame = WallFrame(wall);
    room_.scene.Add(Tiled(frame.origin + h * kUp, WallLength(wall) * frame.right, -h * kUp,
                          walls.texture, walls.width, walls.height));
    room_.scene.Add(Tiled(frame.origin + fashion.skirting * kUp + 0.015f * frame.normal,
                          WallLength(wall) * frame.right, -fashion.skirting * kUp,
                          building.dark_wood, 1, 1));
  }
  room_.scene.Add(
      Tiled({0, d, 0}, {w, 0, 0}, {0, -d, 0}, floor, fashion.floor_repeat, fashion.floor_repeat));
  room_.scene.Add(Tiled({0, 0, h}, {w, 0, 0}, {0, d, 0}, building.ceiling, fashion.ceiling_repeat,
                        fashion.ceiling_repeat));
  Lamps(brightness);
}

void RoomBuilder::Lamps(float brightness) {
  const Fashion& fashion = building.fashion;
  const int rows = room_.width < 5 ? 1 : fashion.lamp_rows;
  const float between = room_.width / static_cast<float>(rows);
  // As much light a square metre as one lamp of 1.5 on 4 x 2.4 m gives.
  const float power = 1.5f * brightness * between * fashion.lamp_pitch / 9.6f;
  const float along_x = fashion.lamps_along ? fashion.lamp_width : fashion.lamp_length;
  const float along_y = fashion.lamps_along ? fashion.lamp_length : fashion.lamp_width;
  for (float y = 0.6f * fashion.lamp_pitch; y < room_.depth - 0.8f; y += fashion.lamp_pitch) {
    for (int row = 0; row < rows; ++row) {
      const float x = between * (static_cast<float>(row) + 0.5f);
      const float z = room_.height - 0.02f;
      Quad lamp{
          {x - along_x / 2, y - along_y / 2, z}, {along_x, 0, 0}, {0, along_y, 0}, building.lamp};
      lamp.glow = 1.1f * brightness;
      lamp.casts_shadow = false;
      room_.scene.Add(lamp);
      room_.scene.AddLamp({{x, y, room_.height - 0.25f}, power});
    }
  }
}

void RoomBuilder::Hang(Wall wall, float centre, float bottom, float width, float height,
                       TexturePtr texture, float glow) {
  constexpr float kStandOff = 0.04f;
  const Frame frame = WallFrame(wall);
  const Vector3f corner = OnWall(wall, centre - width / 2, bottom + height, kStandOff);
  const Vector3f right = width * frame.right, down = -height * kUp;
  Quad front{corner, right, down, std::move(texture)};
  front.glow = glow;
  room_.scene.Add(front);
  const Vector3f back = -kStandOff * frame.normal;
  Quad edges[] = {{corner + back, right, -back, building.dark_wood},
                  {corner + down, right, back, building.dark_wood},
                  {corner + back, -back, down, building.dark_wood},
                  {corner + right, back, down, building.dark_wood}};
  for (Quad& edge : edges) {
    edge.casts_shadow = false;
    room_.scene.Add(edge);
  }
}

void RoomBuilder::Box(Vector3f centre_bottom, Vector3f size, TexturePtr sides, TexturePtr top,
                      float yaw, TexturePtr front) {
  const Vector3f x(std::cos(yaw), std::sin(yaw), 0), y(-std::sin(yaw), std::cos(yaw), 0);
  const Vector3f hx = size.x() / 2 * x, hy = size.y() / 2 * y, z = size.z() * kUp;
  const Vector3f c = centre_bottom;
  const bool large = std::max({size.x(), size.y(), size.z()}) > 0.25f;
  const auto add = [&](Vector3f corner, Vector3f right, Vector3f down, const TexturePtr& texture) {
    Quad quad{corner, right, down, texture};
    quad.casts_shadow = large;
    room_.scene.Add(quad);
  };
  add(c - hx - hy + z, 2 * hx, -z, front ? front : sides);  // faces -y
  add(c + hx - hy + z, 2 * hy, -z, sides);
  add(c + hx + hy + z, -2 * hx, -z, sides);
  add(c - hx + hy + z, -2 * hy, -z, sides);
  add(c - hx + hy + z, 2 * hx, -2 * hy, top ? top : sides);
  if (c.z() > 0.3f) add(c - hx - hy, 2 * hx, 2 * hy, sides);
}

void RoomBuilder::Cylinder(Vector3f centre_bottom, float radius, float height, TexturePtr side,
                           TexturePtr cap, int faces) {
  const float step = 2 * static_cast<float>(M_PI) / static_cast<float>(faces);
  for (int i = 0; i < faces; ++i) {
    const float a = step * static_cast<float>(i), b = a + step;
    const Vector3f from(radius * std::cos(a), radius * std::sin(a), height);
    const Vector3f to(radius * std::cos(b), radius * std::sin(b), height);
    Quad quad{centre_bottom + from, to - from, -height * kUp, side};
    quad.repeat_u = 1.f / static_cast<float>(faces) * (radius > 0.15f ? 2.f : 1.f);
    quad.casts_shadow = radius > 0.12f;
    room_.scene.Add(quad);
  }
  if (!cap) return;
  Quad top{centre_bottom + Vector3f(-radius, radius, height),
           {2 * radius, 0, 0},
           {0, -2 * radius, 0},
           std::move(cap)};
  top.casts_shadow = radius > 0.12f;
  room_.scene.Add(top);
}

void RoomBuilder::CutOut(Vector3f centre_bottom, float width, float height, TexturePtr texture,
                         bool crossed, float yaw) {
  for (const float turn : {0.f, 1.5707963f}) {
    if (turn > 0 && !crossed) break;
    const Vector3f right(width * std::cos(yaw + turn), width * std::sin(yaw + turn), 0);
    Quad quad{centre_bottom - right / 2 + height * kUp, right, -height * kUp, texture};
    quad.two_sided = true;
    quad.casts_shadow = false;
    room_.scene.Add(quad);
  }
}

void RoomBuilder::FloorPatch(float x, float y, float width, float depth, TexturePtr texture) {
  room_.scene.Add(
      {{x - width / 2, y + depth / 2, 0.012f}, {width, 0, 0}, {0, -depth, 0}, std::move(texture)});
}

void RoomBuilder::Approaches(float side_heading) {
  const float w = room_.width, d = room_.depth;
  const float ahead = 1.5707963f;
  const auto side = [&](const char* view, float wall_x) {
    const float turn = side_heading * Draw(0.85, 1.15);
    const float y = d * Draw(0.62, 0.74);
    const float farthest = std::min((y - 1.0f) / std::cos(turn), (w - 1.0f) / std::sin(turn));
    const float nearest = Draw(1.3, 1.9);
    return Approach{view,
                    {wall_x, y, 1.45f},
                    wall_x > 0 ? ahead - turn : ahead + turn,
                    nearest,
                    std::max(nearest + 1.5f, std::min(farthest, Draw(4.9, 5.7)))};
  };
  const Approach middle{"middle",
                        {w * Draw(0.46, 0.54), d, 1.45f},
                        ahead + Draw(-0.1, 0.1),
                        Draw(1.9, 2.7),
                        std::min(d - 1.2f, Draw(6.2, 7.4))};
  room_.approaches = {side("left", 0), middle, side("right", w)};
}

void RoomBuilder::Sign(Wall wall, float centre, const std::string& text, float widest) {
  const cv::Mat image = DrawSign(text, building.fashion.sign_ground, building.fashion.sign_ink);
  const float height = Draw(0.26, 0.42);
  const float most = widest > 0 ? widest : WallLength(wall) - 0.4f;
  const float width =
      std::min(most, height * static_cast<float>(image.cols) / static_cast<float>(image.rows));
  const float middle = std::clamp(centre, width / 2 + 0.1f, WallLength(wall) - width / 2 - 0.1f);
  Hang(wall, middle, room_.height - height - 0.1f, width, height, Bake(image));
}

WallThing RoomBuilder::Picture(float width, float height, float bottom, TexturePtr texture,
                               float glow) {
  const float scale = Draw(0.75, 1.2);
  const float w = scale * width, h = scale * height;
  // Below the signs, and as low as it was meant to hang at most.
  const float z = std::max(0.05f, std::min(bottom + Draw(-0.15, 0.2), room_.height - kSigns - h));
  return {w, [this, w, h, z, glow, texture = std::move(texture)](Wall wall, float along) {
            Hang(wall, along, z, w, h, texture, glow);
          }};
}

WallThing RoomBuilder::Poster() { return Picture(0.78f, 1.12f, 1.0f, StockPoster()); }

WallThing RoomBuilder::Door() {
  const Fashion& fashion = building.fashion;
  return {fashion.door_width, [this, &fashion](Wall wall, float along) {
            Hang(wall, along, 0, fashion.door_width, fashion.door_height, Any(building.doors));
            Hang(wall, along, fashion.door_height + 0.06f, 0.6f, 0.2f, building.exit_sign, 0.5f);
            const Vector3f before = OnWall(wall, along, 0, 0);
            Occupy(before.x(), before.y(), 1.2f, 1.2f);
          }};
}

WallThing RoomBuilder::Extinguisher() { return Picture(0.22f, 0.6f, 0.8f, building.extinguisher); }

WallThing RoomBuilder::Shelves(float width, int boards, float board_height,
                               cv::Mat (*draw)(Random&)) {
  const float w = width * Draw(0.75, 1.25);
  const float step = board_height * Draw(0.85, 1.15);
  const float bottom = Draw(0.08, 0.5);
  const int count =
      std::min(boards, static_cast<int>((room_.height - kSigns - bottom - 0.1f) / step));
  return {w + 0.1f,
          [=, this](Wall wall, float along) { Shelf(wall, along, w, count, step, bottom, draw); }};
}

void RoomBuilder::Spread(Wall wall, float from, float to, std::vector<WallThing> things) {
  constexpr float kLeastGap = 0.12f;
  float slack = to - from - kLeastGap;
  std::vector<WallThing> placed;
  for (WallThing& thing : things) {
    if (thing.width + kLeastGap > slack) continue;
    slack -= thing.width + kLeastGap;
    placed.push_back(std::move(thing));
  }
  for (std::size_t i = placed.size(); i > 1; --i) {
    std::swap(placed[i - 1], placed[static_cast<std::size_t>(layout.Below(static_cast<int>(i)))]);
  }
  std::vector<float> gaps;
  for (std::size_t i = 0; i <= placed.size(); ++i) gaps.push_back(Draw(0.1, 1));
  const float stretch = slack / std::accumulate(gaps.begin(), gaps.end(), 0.0f);
  float along = from;
  for (std::size_t i = 0; i < placed.size(); ++i) {
    along += kLeastGap + stretch * gaps[i] + placed[i].width / 2;
    placed[i].put(wall, along);
    along += placed[i].width / 2;
  }
}

void RoomBuilder::SpreadBack(std::vector<WallThing> things, int posters) {
  constexpr float kEdge = 0.3f;
  for (; posters > 0; --posters) things.push_back(Poster());
  Spread(Wall::kBack, kEdge, room_.width - kEdge, std::move(things));
}

void RoomBuilder::SpreadSides(std::vector<WallThing> things) {
  things.insert(things.begin(), {Door(), Door(), Extinguisher()});
  for (int i = Count(3, 5); i > 0; --i) things.push_back(Poster());
  std::array<std::vector<WallThing>, 2> sides;
  std::array<float, 2> taken{};
  for (WallThing& thing : things) {
    const std::size_t side = taken[0] + Draw(-0.6, 0.6) < taken[1] ? 0 : 1;
    taken[side] += thing.width;
    sides[side].push_back(std::move(thing));
  }
  // The part next to the entrance is behind every camera.
  const float unseen = 0.12f * room_.depth, corner = kCorner;
  Spread(Wall::kLeft, unseen, room_.depth - corner, std::move(sides[0]));
  Spread(Wall::kRight, corner, room_.depth - unseen, std::move(sides[1]));
}

bool RoomBuilder::IsFree(const Eigen::AlignedBox2f& place) const {
  constexpr float kApart = 0.1f, kPassage = 0.55f;
  for (const Eigen::AlignedBox2f& other : occupied_) {
    if (place.exteriorDistance(other) < kApart) return false;
  }
  for (const Approach& approach : room_.approaches) {
    const Eigen::Vector2f along(std::cos(approach.heading), std::sin(approach.heading));
    for (float distance = approach.nearest; distance < approach.farthest + 0.25f;
         distance += 0.25f) {
      const Eigen::Vector2f stand = approach.target.head<2>() - distance * along;
      if (place.exteriorDistance(stand) < kPassage) return false;
    }
  }
  return true;
}

void RoomBuilder::Occupy(float x, float y, float width, float depth) {
  const Eigen::Vector2f half(width / 2, depth / 2), at(x, y);
  occupied_.emplace_back(at - half, at + half);
}

void RoomBuilder::Scatter(int count, float width, float depth,
                          const std::function<void(float x, float y)>& put) {
  constexpr float kOffWall = 0.06f, kEntrance = 0.3f;
  const Eigen::Vector2f half(width / 2, depth / 2);
  for (int attempt = 0; count > 0 && attempt < 200; ++attempt) {
    const float x = Draw(double{half.x() + kOffWall}, double{room_.width - half.x() - kOffWall});
    const float y =
        Draw(double{kEntrance * room_.depth}, double{room_.depth - half.y() - kOffWall});
    const Eigen::Vector2f at(x, y);
    if (!IsFree({at - half, at + half})) continue;
    Occupy(x, y, width, depth);
    put(x, y);
    --count;
  }
}

}  // namespace viewfix::simulation
