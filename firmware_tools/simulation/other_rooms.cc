// SPDX-License-Identifier: BSD-3-Clause
#include <opencv2/imgproc.hpp>

#include "firmware_tools/simulation/draw.h"
#include "firmware_tools/simulation/rooms.h"

// Rooms that belong to no location.
namespace viewfix::simulation {
namespace {

WallThing Board(RoomBuilder& b, cv::Mat (*draw)(Random&), float glow = 0) {
  const float width = b.Draw(1.8, 2.8);
  return b.Picture(width, b.Draw(1.2, 1.7), 0.9f, Bake(draw(b.random)), glow);
}

void Desk(RoomBuilder& b, float x, float y) {
  const float top = b.building.fashion.table_height;
  b.Table(x, y, 1.4f, 0.7f);
  b.Box({x, y + 0.15f, top + 0.08f}, {0.55f, 0.05f, 0.36f}, b.building.black, nullptr, 0,
        Bake(DrawScreen(b.random)));
  b.Box({x, y + 0.15f, top}, {0.2f, 0.16f, 0.08f}, b.building.metal);
  b.Box({x + 0.5f, y, top}, {0.22f, 0.3f, 0.12f}, Bake(DrawBooks(b.random)));
  b.Chair(x, y - 0.6f, 3.14f);
}

}  // namespace

void Office(RoomBuilder& b) {
  b.Approaches();
  b.Shell(b.building.coverings[0], RoomFloor(b));
  b.SpreadBack({Board(b, DrawWhiteboard)}, 2);
  b.SpreadSides({b.Shelves(2.2f, 4, 0.38f, DrawBooks), Board(b, DrawNoticeBoard)});
  b.Scatter(b.Count(3, 5), 1.5f, 1.5f, [&](float x, float y) { Desk(b, x, y); });
  b.Scatter(1, 0.8f, 0.8f, [&](float x, float y) { b.Plant(x, y); });
}

void Classroom(RoomBuilder& b) {
  b.Approaches();
  OwnShell(b);
  const std::string lesson = Capitals(RandomWord(b.random));
  b.SpreadBack(
      {b.Picture(2.0f, 1.5f, 0.9f, Bake(DrawMenu(b.random, lesson))), Board(b, DrawWhiteboard)}, 2);
  b.SpreadSides({Board(b, DrawWindow, 0.5f), Board(b, DrawNoticeBoard)});
  b.Scatter(b.Count(4, 6), 1.4f, 1.3f,
            [&](float x, float y) { b.Table(x, y, 1.3f, 0.6f), b.Chair(x, y - 0.5f, 3.14f); });
}

void Store(RoomBuilder& b) {
  b.Approaches();
  b.Shell(RoomWalls(b), b.building.floor, 0.8f);
  b.SpreadBack({}, 2);
  b.Sign(Wall::kBack, b.width() / 2, "STORE " + Capitals(RandomWord(b.random)));
  b.SpreadSides({b.Shelves(2.4f, 4, 0.5f, DrawBottles), b.Shelves(2.4f, 4, 0.5f, DrawBottles)});
  b.Scatter(b.Count(14, 20), 0.8f, 0.8f, [&](float x, float y) {
    const float size = b.Draw(0.35, 0.58), second = b.Draw(0, 1);
    b.Box({x, y, 0}, {size, size, 0.5f}, b.Any(b.building.wood_boxes), nullptr, b.Draw(-0.3, 0.3));
    if (second < 0.4f) return;
    b.Box({x, y, 0.5f}, {0.3f, 0.3f, 0.35f}, b.Any(b.building.wood_boxes), nullptr,
          b.Draw(-0.3, 0.3));
  });
}

namespace {

WallThing Locker(RoomBuilder& b, float width, float height, const cv::Scalar& colour) {
  cv::Mat locker(256, 96, CV_8UC3, colour);
  for (int y = 30; y < 80; y += 12) cv::line(locker, {24, y}, {72, y}, {40, 40, 40}, 4);
  cv::putText(locker, std::to_string(b.random.Below(90) + 10), {26, 130}, cv::FONT_HERSHEY_DUPLEX,
              1, {250, 250, 250}, 2, cv::LINE_AA);
  cv::rectangle(locker, {0, 0, 96, 256}, {50, 50, 50}, 5);
  return {width, [=, &b, texture = Bake(locker)](Wall wall, float along) {
            b.Hang(wall, along, 0.1f, width, height, texture);
          }};
}

}  // namespace

void Lockers(RoomBuilder& b) {
  b.Approaches();
  b.Shell(RoomWalls(b), b.building.floor);
  const cv::Scalar colours[] = {RandomColour(b.random, 60, 200, 80, 200),
                                RandomColour(b.random, 60, 200, 80, 200)};
  const float width = b.Draw(0.4, 0.6), height = b.Draw(1.6, 2.0);
  const auto row = [&](int count) {
    std::vector<WallThing> lockers;
    for (int i = 0; i < count; ++i) {
      lockers.push_back(Locker(b, width, height, colours[b.random.Below(2)]));
    }
    return lockers;
  };
  b.SpreadBack(row(8), 2);
  b.SpreadSides(row(14));
  b.Scatter(b.Count(1, 3), 2.4f, 0.5f, [&](float x, float y) { b.Bench(x, y, 2.2f, 0.4f); });
}

void Workshop(RoomBuilder& b) {
  b.Approaches();
  b.Shell(RoomWalls(b), b.building.floor);
  b.SpreadBack({Board(b, DrawNoticeBoard)}, 2);
  b.SpreadSides({b.Shelves(1.8f, 5, 0.36f, DrawBottles), Board(b, DrawWindow, 0.5f)});
  b.Scatter(b.Count(2, 4), 1.9f, 0.9f, [&](float x, float y) {
    const float top = b.building.fashion.table_height;
    b.Table(x, y, 1.8f, 0.8f), b.Vase({x - 0.4f, y, top}, 0.8f);
    b.Box({x + 0.4f, y, top}, {0.4f, 0.3f, 0.3f}, b.Any(b.building.wood_boxes));
  });
  b.Scatter(b.Count(1, 2), 0.7f, 0.7f, [&](float x, float y) { b.Pillar(x, y); });
}

}  // namespace viewfix::simulation
