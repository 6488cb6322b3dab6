// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>

#include "firmware_tools/simulation/room_builder.h"

namespace viewfix::simulation {
namespace {

using Eigen::Vector3f;

const Vector3f kUp = Vector3f::UnitZ();

}  // namespace

void RoomBuilder::Table(float x, float y, float width, float depth) {
  const float height = building.fashion.table_height, leg = building.fashion.table_leg;
  Box({x, y, height - 0.05f}, {width, depth, 0.05f}, building.wood);
  for (const float sx : {-1.f, 1.f}) {
    for (const float sy : {-1.f, 1.f}) {
      Box({x + sx * (width / 2 - 0.06f), y + sy * (depth / 2 - 0.06f), 0},
          {leg, leg, height - 0.05f}, building.dark_wood);
    }
  }
}

void RoomBuilder::Chair(float x, float y, float yaw) {
  const Vector3f back(-std::sin(yaw), std::cos(yaw), 0);
  const float seat = building.fashion.seat_height, tall = building.fashion.seat_back;
  Box({x, y, seat}, {0.42f, 0.42f, 0.04f}, building.wood, nullptr, yaw);
  Box(Vector3f(x, y, seat + 0.04f) + 0.2f * back, {0.42f, 0.03f, tall}, building.wood, nullptr,
      yaw);
  for (const float sx : {-0.18f, 0.18f}) {
    for (const float sy : {-0.18f, 0.18f}) {
      const Vector3f side(std::cos(yaw), std::sin(yaw), 0);
      Box(Vector3f(x, y, 0) + sx * side + sy * back, {0.035f, 0.035f, seat}, building.dark_wood);
    }
  }
}

void RoomBuilder::Bench(float x, float y, float width, float depth) {
  Box({x, y, 0.38f}, {width, depth, 0.07f}, building.wood);
  const bool across = width > depth;
  for (const float side : {-0.4f, 0.4f}) {
    const Vector3f foot(across ? side * width : 0, across ? 0 : side * depth, 0);
    const Vector3f size(across ? 0.08f : 0.8f * width, across ? 0.8f * depth : 0.08f, 0.38f);
    Box(Vector3f(x, y, 0) + foot, size, building.metal);
  }
}

void RoomBuilder::Pillar(float x, float y) {
  const float radius = building.fashion.pillar_radius, foot = 2.6f * radius;
  Box({x, y, 0}, {foot, foot, 0.18f}, building.marble);
  Cylinder({x, y, 0.18f}, radius, room_.height - 0.38f, building.marble, nullptr,
           building.fashion.pillar_faces);
  Box({x, y, room_.height - 0.2f}, {foot, foot, 0.2f}, building.marble);
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
  const TexturePtr glaze = Bake(DrawWallpaper(
      random, {random.Uniform(30, 220), random.Uniform(30, 200), random.Uniform(30, 220)}));
  for (std::size_t i = 0; i < building.fashion.vase.size(); ++i) {
    Cylinder(base + 0.09f * scale * static_cast<float>(i) * kUp,
             0.18f * scale * building.fashion.vase[i], 0.09f * scale, glaze, building.disc_dark,
             10);
  }
}

void RoomBuilder::Plant(float x, float y) {
  const float size = Draw(0.7, 1.15);
  CutOut({x, y, 0}, 0.9f * size, 1.35f * size, Any(building.plants), true, Draw(0, 1.5));
}

void RoomBuilder::Shelf(Wall wall, float centre, float width, int boards, float board_height,
                        float bottom, cv::Mat (*draw)(Random&)) {
  const float thick = building.fashion.shelf_board, reach = building.fashion.shelf_depth;
  const Frame frame = WallFrame(wall);
  const Vector3f right = width * frame.right;
  const float height = static_cast<float>(boards) * board_height;
  const Vector3f out = reach * frame.normal;
  const auto board = [&](const Vector3f& at, const Vector3f& u, const Vector3f& v) {
    Quad quad{at, u, v, building.wood};
    quad.repeat_u = u.norm();
    quad.repeat_v = v.norm();
    room_.scene.Add(std::move(quad));
  };
  for (int i = 0; i <= boards; ++i) {
    const Vector3f corner =
        OnWall(wall, centre - width / 2, bottom + static_cast<float>(i) * board_height, 0);
    board(corner + thick * kUp + out, right, -thick * kUp);
    board(corner + thick * kUp, right, out);
    board(corner + out, right, -out);
    if (i == boards) break;
    const int parts = std::max(1, static_cast<int>(std::round(width / 1.2f)));
    for (int part = 0; part < parts; ++part) {
      const Vector3f piece = right / static_cast<float>(parts);
      room_.scene.Add(
          {corner + static_cast<float>(part) * piece + (board_height * 0.92f) * kUp + 0.75f * out,
           piece, -(board_height * 0.92f - thick) * kUp, Bake(draw(random))});
    }
  }
  const Vector3f middle = OnWall(wall, centre, 0, reach / 2);
  const Vector3f floor = right.cwiseAbs() + out.cwiseAbs();
  Occupy(middle.x(), middle.y(), floor.x(), floor.y());
  for (const float side : {-0.5f, 0.5f}) {
    const Vector3f foot = OnWall(wall, centre + side * (width + 0.04f), bottom, reach / 2);
    const float yaw = std::atan2(frame.right.y(), frame.right.x());
    Box(foot, {0.04f, reach, height + thick}, building.wood, nullptr, yaw);
  }
}

}  // namespace viewfix::simulation
