// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/simulation/room_builder.h"

#include <cmath>

namespace viewfix::simulation {
namespace {

using Eigen::Vector3f;

const Vector3f kUp = Vector3f::UnitZ();

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

void RoomBuilder::Shell(TexturePtr walls, float texture_width, float texture_height,
                        TexturePtr floor, float brightness) {
  const float w = room_.width, d = room_.depth, h = room_.height;
  Scene& scene = room_.scene;
  for (const Wall wall : {Wall::kLeft, Wall::kBack, Wall::kRight, Wall::kFront}) {
    const Frame frame = WallFrame(wall);
    scene.Add(Tiled(frame.origin + h * kUp, WallLength(wall) * frame.right, -h * kUp, walls,
                    texture_width, texture_height));
    const Vector3f out = 0.015f * frame.normal;
    scene.Add(Tiled(frame.origin + 0.1f * kUp + out, WallLength(wall) * frame.right, -0.1f * kUp,
                    building.dark_wood, 1, 1));
  }
  scene.Add(Tiled({0, d, 0}, {w, 0, 0}, {0, -d, 0}, std::move(floor), 2.4f, 2.4f));
  scene.Add(Tiled({0, 0, h}, {w, 0, 0}, {0, d, 0}, building.ceiling, 1.2f, 1.2f));
  for (float y = 1.6f; y < d; y += 2.4f) {
    for (const float x : {0.28f * w, 0.72f * w}) {
      Quad lamp{{x - 0.6f, y - 0.15f, h - 0.02f}, {1.2f, 0, 0}, {0, 0.3f, 0}, building.lamp};
      lamp.glow = 1.1f * brightness;
      lamp.casts_shadow = false;
      scene.Add(lamp);
      scene.AddLamp({{x, y, h - 0.25f}, 1.5f * brightness});
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

void RoomBuilder::Table(float x, float y, float width, float depth, float height) {
  Box({x, y, height - 0.05f}, {width, depth, 0.05f}, building.wood);
  for (const float sx : {-1.f, 1.f}) {
    for (const float sy : {-1.f, 1.f}) {
      Box({x + sx * (width / 2 - 0.06f), y + sy * (depth / 2 - 0.06f), 0},
          {0.05f, 0.05f, height - 0.05f}, building.dark_wood);
    }
  }
}

void RoomBuilder::Chair(float x, float y, float yaw) {
  const Vector3f back(-std::sin(yaw), std::cos(yaw), 0);
  Box({x, y, 0.42f}, {0.42f, 0.42f, 0.04f}, building.wood, nullptr, yaw);
  Box(Vector3f(x, y, 0.5f) + 0.2f * back, {0.42f, 0.03f, 0.42f}, building.wood, nullptr, yaw);
  for (const float sx : {-0.18f, 0.18f}) {
    for (const float sy : {-0.18f, 0.18f}) {
      const Vector3f side(std::cos(yaw), std::sin(yaw), 0);
      Box(Vector3f(x, y, 0) + sx * side + sy * back, {0.035f, 0.035f, 0.42f}, building.dark_wood);
    }
  }
}

void RoomBuilder::Bench(float x, float y, float width, float depth) {
  Box({x, y, 0.38f}, {width, depth, 0.07f}, building.wood);
  for (const float side : {-0.4f, 0.4f}) {
    Box({x + side * width, y, 0}, {0.08f, depth * 0.8f, 0.38f}, building.metal);
  }
}

void RoomBuilder::Pillar(float x, float y) {
  Box({x, y, 0}, {0.5f, 0.5f, 0.18f}, building.marble);
  Cylinder({x, y, 0.18f}, 0.19f, room_.height - 0.38f, building.marble, nullptr, 12);
  Box({x, y, room_.height - 0.2f}, {0.5f, 0.5f, 0.2f}, building.marble);
}

void RoomBuilder::Rope(float x0, float y0, float x1, float y1) {
  const Vector3f a(x0, y0, 0), b(x1, y1, 0);
  for (const Vector3f& at : {a, b}) {
    Cylinder(at, 0.15f, 0.03f, building.metal, building.disc_dark, 8);
    Cylinder(at, 0.025f, 0.92f, building.metal, nullptr, 6);
    Cylinder(at + 0.92f * kUp, 0.045f, 0.06f, building.metal, building.disc_light, 6);
  }
  constexpr int kPieces = 6;  // a sagging rope of straight pieces
  const float yaw = std::atan2(y1 - y0, x1 - x0), length = (b - a).norm() / kPieces;
  for (int i = 0; i < kPieces; ++i) {
    const float part = (static_cast<float>(i) + 0.5f) / kPieces;
    const float sag = 0.3f * 4 * part * (1 - part);
    Box(a + part * (b - a) + (0.86f - sag) * kUp, {length * 1.02f, 0.035f, 0.05f}, building.rug,
        nullptr, yaw);
  }
}

void RoomBuilder::Plinth(float x, float y, float height) {
  Box({x, y, 0}, {0.56f, 0.56f, 0.1f}, building.marble);
  Box({x, y, 0.1f}, {0.46f, 0.46f, height - 0.16f}, building.white);
  Box({x, y, height - 0.06f}, {0.54f, 0.54f, 0.06f}, building.marble);
}

void RoomBuilder::Vase(Vector3f base, float scale) {
  static constexpr float kProfile[] = {0.6f, 0.9f, 1.0f, 0.85f, 0.5f, 0.35f, 0.55f};
  const TexturePtr glaze = Bake(DrawWallpaper(
      random, {random.Uniform(30, 220), random.Uniform(30, 200), random.Uniform(30, 220)}));
  for (int i = 0; i < 7; ++i) {
    Cylinder(base + 0.09f * scale * static_cast<float>(i) * kUp, 0.18f * scale * kProfile[i],
             0.09f * scale, glaze, building.disc_dark, 10);
  }
}

void RoomBuilder::Plant(float x, float y) {
  const TexturePtr plant = building.plants[random.Below(static_cast<int>(building.plants.size()))];
  CutOut({x, y, 0}, 0.9f, 1.35f, plant, true, static_cast<float>(random.Uniform(0, 1.5)));
}

void RoomBuilder::Shelf(Wall wall, float centre, float width, int boards, float board_height,
                        float bottom, cv::Mat (*draw)(Random&)) {
  constexpr float kDepth = 0.32f;
  const Frame frame = WallFrame(wall);
  const Vector3f right = width * frame.right;
  const float height = static_cast<float>(boards) * board_height;
  const Vector3f out = kDepth * frame.normal;
  for (int i = 0; i <= boards; ++i) {
    const Vector3f corner =
        OnWall(wall, centre - width / 2, bottom + static_cast<float>(i) * board_height, 0);
    room_.scene.Add(Tiled(corner + 0.03f * kUp + out, right, -0.03f * kUp, building.wood, 1, 1));
    room_.scene.Add(Tiled(corner + 0.03f * kUp, right, out, building.wood, 1, 1));
    room_.scene.Add(Tiled(corner + out, right, -out, building.wood, 1, 1));
    if (i == boards) break;
    const int parts = std::max(1, static_cast<int>(std::round(width / 1.2f)));
    for (int part = 0; part < parts; ++part) {
      const Vector3f piece = right / static_cast<float>(parts);
      room_.scene.Add(
          {corner + static_cast<float>(part) * piece + (board_height * 0.92f) * kUp + 0.75f * out,
           piece, -(board_height * 0.92f - 0.03f) * kUp, Bake(draw(random))});
    }
  }
  for (const float side : {-0.5f, 0.5f}) {
    const Vector3f foot = OnWall(wall, centre + side * (width + 0.04f), bottom, kDepth / 2);
    const float yaw = std::atan2(frame.right.y(), frame.right.x());
    Box(foot, {0.04f, kDepth, height + 0.03f}, building.wood, nullptr, yaw);
  }
}

void RoomBuilder::SharedArchitecture(int doors) {
  const float d = room_.depth;
  const Wall sides[] = {Wall::kLeft, Wall::kRight, Wall::kFront};
  for (int i = 0; i < doors; ++i) {
    const Wall wall = sides[i % 3];
    const float along = wall == Wall::kLeft    ? 0.16f * d
                        : wall == Wall::kRight ? 0.84f * d
                                               : room_.width / 2;
    Hang(wall, along, 0, 0.98f, 2.1f,
         building.doors[random.Below(static_cast<int>(building.doors.size()))]);
    if (wall != Wall::kFront) Hang(wall, along, 2.2f, 0.6f, 0.22f, building.exit_sign, 0.5f);
  }
  Hang(Wall::kLeft, 0.27f * d, 0.7f, 0.22f, 0.6f, building.extinguisher);
}

void RoomBuilder::StandardApproaches(float side_y, float side_heading, float near_side,
                                     float far_side, float near_middle, float far_middle) {
  const float ahead = 1.5707963f;
  room_.approaches = {
      Approach{"left", {0, side_y, 1.45f}, ahead + side_heading, near_side, far_side},
      Approach{"middle", {room_.width / 2, room_.depth, 1.45f}, ahead, near_middle, far_middle},
      Approach{"right", {room_.width, side_y, 1.45f}, ahead - side_heading, near_side, far_side}};
}

}  // namespace viewfix::simulation
