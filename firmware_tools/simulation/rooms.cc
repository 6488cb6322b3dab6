// SPDX-License-Identifier: BSD-3-Clause
#include <functional>
#include <map>
#include <opencv2/imgproc.hpp>

#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/simulation/room_builder.h"

namespace viewfix::simulation {
namespace {

using Eigen::Vector3f;

constexpr float kSide = 0.78f;  // radians between the middle view and the others

void HangPosters(RoomBuilder& b, Wall wall, std::initializer_list<float> places,
                 float bottom = 1.0f) {
  for (const float place : places) b.Hang(wall, place, bottom, 0.72f, 1.04f, b.Poster());
}

void SetTable(RoomBuilder& b, float x, float y) {
  b.Table(x, y, 0.8f, 0.8f);
  b.Chair(x, y + 0.62f, 0);
  b.Chair(x, y - 0.62f, 3.14f);
  for (int i = 0; i < 3; ++i) {
    const Vector3f at(x + static_cast<float>(b.random.Uniform(-0.28, 0.28)),
                      y + static_cast<float>(b.random.Uniform(-0.28, 0.28)), 0.74f);
    b.Cylinder(at, 0.08f, 0.012f, b.building.white, b.building.disc_light, 8);
    b.Cylinder(at, 0.04f, 0.09f, b.building.white, b.building.disc_dark, 8);
  }
  b.Box({x, y, 0.74f}, {0.14f, 0.06f, 0.2f}, Bake(DrawMenu(b.random, "MENU")));
}

void Cafe(RoomBuilder& b) {
  const Building& s = b.building;
  b.Shell(Bake(DrawBricks(b.random, {70, 90, 165})), 2.0f, 1.2f, s.wood);
  b.SharedArchitecture(2);
  b.Box({4, 6.9f, 0}, {4.4f, 0.6f, 1.0f}, Bake(DrawWood(b.random, {60, 100, 140}, 8)));
  b.Box({4, 6.9f, 1.0f}, {4.6f, 0.75f, 0.06f}, s.marble);
  b.Hang(Wall::kBack, 4, 2.62f, 2.2f, 0.42f,
         Bake(DrawSign("MUSEUM CAFE", {30, 60, 40}, {170, 225, 250})));
  int i = 0;
  for (const char* title : {"COFFEE", "CAKES", "LUNCH"}) {
    b.Hang(Wall::kBack, 2.4f + 1.6f * static_cast<float>(i++), 1.45f, 0.95f, 1.12f,
           Bake(DrawMenu(b.random, title)));
  }
  b.Box({3.0f, 6.95f, 1.06f}, {0.6f, 0.42f, 0.46f}, s.metal, s.metal, 0,
        Bake(DrawScreen(b.random)));
  b.Box({5.2f, 6.9f, 1.06f}, {1.1f, 0.42f, 0.4f}, Bake(DrawBottles(b.random)), s.white);
  for (int cup = 0; cup < 7; ++cup) {
    b.Cylinder({3.5f + 0.14f * static_cast<float>(cup), 6.75f, 1.06f}, 0.05f, 0.11f, s.white,
               s.disc_dark, 8);
  }
  b.Shelf(Wall::kRight, 2.4f, 2.4f, 4, 0.42f, 0.7f, DrawBottles);
  HangPosters(b, Wall::kRight, {4.7f}, 1.1f);
  b.Hang(Wall::kLeft, 5.3f, 0.95f, 2.3f, 1.8f, Bake(DrawWindow(b.random)), 0.5f);
  HangPosters(b, Wall::kLeft, {3.4f, 7.2f}, 1.1f);
  SetTable(b, 1.0f, 6.3f), SetTable(b, 1.1f, 4.4f), SetTable(b, 6.9f, 5.9f),
      SetTable(b, 6.8f, 4.1f);
  b.Plant(0.5f, 7.5f), b.Plant(7.5f, 7.5f);
  b.StandardApproaches(5.4f, kSide, 1.6f, 5.6f, 2.2f, 6.6f);
}

void Hallway(RoomBuilder& b) {
  const Building& s = b.building;
  b.Shell(s.plaster, 2, 2, s.floor);
  b.SharedArchitecture(2);
  for (const float along : {3.3f, 9.9f}) {
    const float other = 12 - along;
    b.Hang(Wall::kLeft, along, 0, 0.98f, 2.1f,
           s.doors[static_cast<std::size_t>(along) % s.doors.size()]);
    b.Hang(Wall::kRight, other, 0, 0.98f, 2.1f,
           s.doors[static_cast<std::size_t>(other) % s.doors.size()]);
  }
  b.Hang(Wall::kLeft, 7.4f, 0.9f, 1.8f, 1.2f, Bake(DrawNoticeBoard(b.random)));
  HangPosters(b, Wall::kLeft, {5.6f, 9.0f});
  b.Hang(Wall::kRight, 4.4f, 0.95f, 1.6f, 1.07f, Bake(DrawFloorPlan(b.random)));
  HangPosters(b, Wall::kRight, {3.1f, 6.1f});
  b.Hang(Wall::kBack, 1.7f, 0.8f, 1.8f, 1.5f, Bake(DrawWindow(b.random)), 0.6f);
  b.Hang(Wall::kBack, 1.7f, 2.5f, 1.5f, 0.35f,
         Bake(DrawSign("ROOMS 1 - 9", {120, 60, 20}, {250, 250, 250})));
  b.Bench(0.4f, 5.6f, 0.5f, 1.5f);
  b.Plant(3.0f, 11.5f);
  b.StandardApproaches(7.5f, 0.62f, 1.2f, 4.7f, 2.0f, 8.0f);
}

void Stairs(RoomBuilder& b) {
  const Building& s = b.building;
  b.Shell(Bake(DrawPlaster(b.random, {150, 205, 222})), 2, 2, s.floor);
  b.SharedArchitecture(2);
  constexpr int kSteps = 11;
  const TexturePtr riser = Bake(DrawMarble(b.random, {140, 150, 155}));
  for (int i = 0; i < kSteps; ++i) {
    const float y0 = 4.9f + 0.28f * static_cast<float>(i), rise = 0.17f;
    const float length = 8.4f - y0;
    b.Box({4, y0 + length / 2, rise * static_cast<float>(i)}, {2.6f, length, rise}, riser,
          s.marble);
    b.Box({4, y0 + 0.015f, rise * static_cast<float>(i) + 0.15f}, {2.62f, 0.04f, 0.025f}, s.black);
    for (const float side : {-1.25f, 1.25f}) {
      b.Cylinder({4 + side, y0 + 0.14f, rise * static_cast<float>(i + 1)}, 0.022f, 0.85f, s.metal,
                 nullptr, 6);
      b.Box({4 + side, y0 + 0.14f, rise * static_cast<float>(i + 1) + 0.85f}, {0.07f, 0.3f, 0.12f},
            s.wood);
    }
  }
  b.Hang(Wall::kBack, 4, 2.35f, 1.3f, 0.9f, Bake(DrawPainting(b.random)));
  b.Hang(Wall::kBack, 1.3f, 1.3f, 1.1f, 1.1f, Bake(DrawSign("2", {30, 120, 220}, {255, 255, 255})));
  b.Hang(Wall::kBack, 6.8f, 1.2f, 1.6f, 1.07f, Bake(DrawFloorPlan(b.random)));
  b.Hang(Wall::kLeft, 5.6f, 0.6f, 1.9f, 1.9f, Bake(DrawWindow(b.random)), 0.5f);
  HangPosters(b, Wall::kLeft, {4.0f, 7.1f});
  b.Hang(Wall::kRight, 2.7f, 0, 1.3f, 2.2f, s.metal);
  b.Hang(Wall::kRight, 2.7f, 2.3f, 0.9f, 0.26f,
         Bake(DrawSign("LIFT", {60, 60, 60}, {240, 240, 240})));
  HangPosters(b, Wall::kRight, {4.2f});
  b.Hang(Wall::kRight, 1.2f, 1.3f, 1.0f, 0.75f,
         Bake(DrawSign("UP", {40, 150, 40}, {255, 255, 255})));
  b.Plant(1.2f, 7.6f), b.Plant(7.2f, 7.4f);
  b.Bench(0.5f, 5.4f, 0.5f, 1.6f);
  b.StandardApproaches(5.4f, kSide, 1.6f, 5.4f, 3.9f, 7.4f);
}

void Lobby(RoomBuilder& b) {
  const Building& s = b.building;
  b.Shell(s.plaster, 2, 2, s.marble);
  b.SharedArchitecture(2);
  const TexturePtr wood = Bake(DrawWood(b.random, {50, 80, 120}, 6));
  b.Box({4.5f, 7.2f, 0}, {3.6f, 0.6f, 1.1f}, wood);
  b.Box({4.5f, 7.15f, 1.1f}, {3.8f, 0.8f, 0.06f}, s.marble);
  b.Box({2.5f, 7.7f, 0}, {0.5f, 1.0f, 1.1f}, wood),
      b.Box({6.5f, 7.7f, 0}, {0.5f, 1.0f, 1.1f}, wood);
  b.Box({4.5f, 6.89f, 0.35f}, {2.0f, 0.02f, 0.4f},
        Bake(DrawSign("RECEPTION", {235, 238, 240}, {120, 50, 30})));
  b.Hang(Wall::kBack, 4.5f, 2.35f, 3.2f, 0.6f,
         Bake(DrawSign("WELCOME TO THE MUSEUM", {110, 50, 25}, {245, 245, 250})));
  b.Hang(Wall::kBack, 3.3f, 1.35f, 1.3f, 0.74f, Bake(DrawScreen(b.random)), 0.6f);
  HangPosters(b, Wall::kBack, {4.8f, 5.8f}, 1.22f);
  b.Box({3.9f, 7.1f, 1.16f}, {0.5f, 0.06f, 0.34f}, s.black, s.black, 0, Bake(DrawScreen(b.random)));
  for (const float y : {3.2f, 7.4f}) b.Pillar(1.0f, y), b.Pillar(8.0f, y);
  b.Hang(Wall::kLeft, 6.0f, 0.1f, 2.8f, 2.5f, Bake(DrawWindow(b.random)), 0.55f);
  HangPosters(b, Wall::kLeft, {4.0f});
  b.Hang(Wall::kRight, 3.1f, 0.9f, 2.2f, 1.47f, Bake(DrawFloorPlan(b.random)));
  b.Hang(Wall::kRight, 3.1f, 2.5f, 1.6f, 0.32f,
         Bake(DrawSign("YOU ARE HERE", {40, 40, 180}, {255, 255, 255})));
  HangPosters(b, Wall::kRight, {5.0f, 1.2f});
  b.FloorPatch(4.5f, 5.2f, 3.4f, 2.2f, Bake(DrawRug(b.random)));
  b.Bench(1.1f, 5.6f, 0.7f, 1.8f), b.Bench(7.9f, 5.6f, 0.7f, 1.8f);
  b.Plant(1.6f, 8.5f), b.Plant(7.5f, 8.4f);
  b.StandardApproaches(5.9f, kSide, 2.0f, 6.3f, 2.6f, 7.6f);
}

// Two of these differ in what they show, hardly in how.
void ShowWindow(RoomBuilder& b, const std::string& number) {
  const Building& s = b.building;
  // The fittings are drawn from one stream for both windows.
  Random fittings(17, "show windows");
  const TexturePtr panel = Bake(DrawWood(fittings, {90, 130, 175}, 6));
  const TexturePtr backdrop = Bake(DrawWallpaper(fittings, {120, 70, 95}));
  const TexturePtr shop_sign = Bake(DrawSign("MUSEUM SHOP", {35, 25, 90}, {190, 230, 255}));
  const TexturePtr hours = Bake(DrawInfoPanel(fittings, "OPEN 10-18"));
  const TexturePtr sale = Bake(DrawPoster(fittings));
  b.Shell(panel, 1.6f, 2.4f, s.floor);
  b.SharedArchitecture(2);
  b.Hang(Wall::kBack, 4, 0.35f, 5.6f, 2.1f, backdrop, 0.12f);
  b.Hang(Wall::kBack, 4, 2.6f, 3.0f, 0.42f, shop_sign);
  b.Box({4, 6.6f, 0}, {6.0f, 0.8f, 0.4f}, panel, s.marble);
  for (int i = 0; i < 4; ++i)
    b.Box({1.1f + 1.933f * static_cast<float>(i), 6.25f, 0.4f}, {0.08f, 0.08f, 2.05f}, s.metal);
  b.Box({4, 6.25f, 2.45f}, {6.0f, 0.1f, 0.12f}, s.metal);
  for (int i = 0; i < 4; ++i) {  // goods: half of them stand in both windows
    const float x = 1.7f + 1.5f * static_cast<float>(i);
    b.CutOut({x, 6.75f, 0.4f}, 0.62f, 1.75f, Bake(DrawMannequin(i % 2 == 0 ? fittings : b.random)),
             false, static_cast<float>(b.random.Uniform(-0.3, 0.3)));
    b.Vase({x + 0.65f, 6.6f, 0.4f}, static_cast<float>(b.random.Uniform(0.7, 1.3)));
  }
  for (const Wall wall : {Wall::kLeft, Wall::kRight}) {
    const float middle = wall == Wall::kLeft ? 4.9f : 2.1f;
    b.Hang(wall, middle, 0.6f, 2.4f, 1.7f, backdrop, 0.12f);
    for (int i = 0; i < 3; ++i) {
      const Vector3f at = b.OnWall(wall, middle - 0.8f + 0.8f * static_cast<float>(i), 0.6f, 0.25f);
      if (i == 1) {
        b.CutOut(at, 0.56f, 1.6f, Bake(DrawMannequin(b.random)), false, 1.57f);
      } else {
        b.Vase(at, 1.2f);
      }
    }
    b.Box(b.OnWall(wall, middle, 0, 0.3f), {0.6f, 2.6f, 0.6f}, panel, s.marble);
    b.Hang(wall, middle - 1.75f, 0.9f, 0.75f, 1.0f, hours);
    b.Hang(wall, middle + 1.75f, 0.95f, 0.72f, 1.04f, wall == Wall::kLeft ? sale : b.Poster());
  }
  b.Hang(Wall::kBack, 7.55f, 1.7f, 0.6f, 0.4f,
         Bake(DrawSign(number, {240, 240, 240}, {30, 30, 30})));
  b.StandardApproaches(4.9f, kSide, 1.7f, 5.0f, 2.2f, 6.2f);
}

void BookShelf(RoomBuilder& b) {
  const Building& s = b.building;
  b.Shell(Bake(DrawPlaster(b.random, {140, 170, 180})), 2, 2, s.wood);
  b.SharedArchitecture(2);
  for (const float x : {2.1f, 4.9f}) b.Shelf(Wall::kBack, x, 2.4f, 6, 0.38f, 0.1f, DrawBooks);
  for (const float y : {3.6f, 5.5f}) {
    b.Shelf(Wall::kLeft, y, 1.7f, 6, 0.38f, 0.1f, DrawBooks);
    b.Shelf(Wall::kRight, 7 - y, 1.7f, 6, 0.38f, 0.1f, DrawBooks);
  }
  int i = 0;
  for (const char* letter : {"A - F", "G - M"}) {
    b.Hang(Wall::kBack, 2.1f + 2.8f * static_cast<float>(i++), 2.5f, 1.0f, 0.3f,
           Bake(DrawSign(letter, {30, 60, 30}, {220, 240, 240})));
  }
  b.Hang(Wall::kLeft, 4.5f, 2.5f, 1.4f, 0.3f,
         Bake(DrawSign("HISTORY", {30, 60, 30}, {220, 240, 240})));
  b.Hang(Wall::kRight, 2.5f, 2.5f, 1.4f, 0.3f,
         Bake(DrawSign("SCIENCE", {30, 60, 30}, {220, 240, 240})));
  b.Table(3.5f, 5.2f, 1.8f, 0.8f), b.Chair(3.0f, 5.8f, 0), b.Chair(4.0f, 5.8f, 0);
  for (int book = 0; book < 5; ++book) {
    b.Box({2.9f + 0.28f * static_cast<float>(book), 5.2f, 0.74f},
          {0.2f, 0.27f, 0.05f + 0.03f * static_cast<float>(book % 3)}, Bake(DrawBooks(b.random)),
          b.Poster(), static_cast<float>(b.random.Uniform(-0.6, 0.6)));
  }
  b.Box({6.4f, 6.3f, 0}, {0.5f, 0.4f, 0.45f}, s.wood),
      b.Box({6.4f, 6.45f, 0.45f}, {0.5f, 0.2f, 0.45f}, s.wood);
  b.StandardApproaches(4.7f, kSide, 1.4f, 4.8f, 1.9f, 6.0f);
}

void VideoRoom(RoomBuilder& b) {
  const Building& s = b.building;
  b.Shell(Bake(DrawWallpaper(b.random, {92, 60, 52})), 1.6f, 1.6f,
          Bake(DrawCarpet(b.random, {70, 60, 66})), 0.55f);
  b.SharedArchitecture(2);
  b.Hang(Wall::kBack, 4, 0.9f, 3.2f, 1.8f, Bake(DrawScreen(b.random)), 0.55f);
  b.Hang(Wall::kBack, 4, 2.78f, 1.6f, 0.3f,
         Bake(DrawSign("VIDEO ROOM", {20, 20, 20}, {80, 220, 255})), 0.3f);
  for (const float x : {1.2f, 6.8f}) {
    b.Hang(Wall::kBack, x, 1.75f, 1.3f, 0.75f, Bake(DrawScreen(b.random)), 0.5f);
    b.Hang(Wall::kBack, x, 0.85f, 1.3f, 0.75f, Bake(DrawScreen(b.random)), 0.5f);
    b.Box({x, 7.3f, 0}, {0.4f, 0.4f, 0.75f}, s.black);
  }
  for (const Wall wall : {Wall::kLeft, Wall::kRight}) {
    const float start = wall == Wall::kLeft ? 3.9f : 1.0f;
    for (int i = 0; i < 3; ++i) {
      const float along = start + 1.5f * static_cast<float>(i);
      b.Hang(wall, along, 1.35f, 1.3f, 0.75f, Bake(DrawScreen(b.random)), 0.5f);
      b.Hang(wall, along, 0.85f, 0.5f, 0.4f, Bake(DrawInfoPanel(b.random, std::to_string(i + 1))));
    }
  }
  b.Bench(4, 4.2f, 2.6f, 0.5f), b.Bench(4, 5.4f, 2.6f, 0.5f);
  b.StandardApproaches(5.4f, kSide, 1.5f, 5.2f, 2.0f, 6.4f);
}

void SpecialRoom(RoomBuilder& b) {
  const Building& s = b.building;
  b.Shell(Bake(DrawWallpaper(b.random, {52, 42, 128})), 1.5f, 1.5f, s.wood);
  b.SharedArchitecture(2);
  b.Hang(Wall::kBack, 4, 1.0f, 2.0f, 1.5f, Bake(DrawPainting(b.random)));
  for (const float x : {1.5f, 6.5f})
    b.Hang(Wall::kBack, x, 1.05f, 1.2f, 1.4f, Bake(DrawPainting(b.random)));
  for (const Wall wall : {Wall::kLeft, Wall::kRight}) {
    const float start = wall == Wall::kLeft ? 3.7f : 1.2f;
    for (int i = 0; i < 3; ++i) {
      b.Hang(wall, start + 1.65f * static_cast<float>(i), 1.05f, 1.25f, i == 1 ? 1.5f : 1.1f,
             Bake(DrawPainting(b.random)));
      b.Hang(wall, start + 1.65f * static_cast<float>(i) + 0.55f, 0.72f, 0.26f, 0.2f,
             Bake(DrawInfoPanel(b.random, "ART")));
    }
  }
  b.FloorPatch(4, 5.0f, 3.6f, 2.4f, Bake(DrawRug(b.random)));
  b.Plinth(2.7f, 7.2f, 1.0f), b.Vase({2.7f, 7.2f, 1.0f}, 1.1f);
  b.Plinth(5.3f, 7.2f, 1.0f), b.Vase({5.3f, 7.2f, 1.0f}, 1.1f);
  b.Rope(2.6f, 6.5f, 4.0f, 6.5f), b.Rope(4.0f, 6.5f, 5.4f, 6.5f);
  b.Rope(0.9f, 4.6f, 0.9f, 6.3f), b.Rope(7.1f, 6.3f, 7.1f, 4.6f);
  b.StandardApproaches(5.4f, kSide, 1.6f, 5.5f, 2.2f, 6.5f);
}

void GlassCase(RoomBuilder& b, float x, float y) {
  b.Box({x, y, 0}, {1.0f, 0.6f, 0.9f}, b.building.white, b.building.marble);
  for (const float sx : {-0.48f, 0.48f}) {
    for (const float sy : {-0.28f, 0.28f})
      b.Box({x + sx, y + sy, 0.9f}, {0.025f, 0.025f, 0.75f}, b.building.metal);
  }
  b.Box({x, y, 1.65f}, {1.0f, 0.6f, 0.04f}, b.building.metal);
  b.CutOut({x - 0.2f, y, 0.92f}, 0.5f, 0.5f, Bake(DrawFossil(b.random)), false,
           static_cast<float>(b.random.Uniform(-0.4, 0.4)));
  b.Vase({x + 0.26f, y, 0.9f}, 0.75f);
  b.Box({x, y - 0.31f, 0.6f}, {0.5f, 0.02f, 0.22f},
        Bake(DrawSign("No " + std::to_string(10 + b.random.Below(90)), {235, 240, 240},
                      {30, 30, 30})));
}

void Exhibit(RoomBuilder& b) {
  const Building& s = b.building;
  b.Shell(Bake(DrawPlaster(b.random, {175, 160, 120})), 2, 2, s.floor);
  b.SharedArchitecture(2);
  b.Hang(Wall::kBack, 4, 2.5f, 2.8f, 0.45f,
         Bake(DrawSign("FOSSILS AND ROCKS", {70, 60, 20}, {235, 250, 250})));
  int i = 0;
  for (const char* title : {"JURASSIC", "TRIASSIC", "PERMIAN", "ORIGINS"}) {
    b.Hang(Wall::kBack, 1.3f + 1.8f * static_cast<float>(i++), 0.95f, 1.05f, 1.4f,
           Bake(DrawInfoPanel(b.random, title)));
  }
  GlassCase(b, 2.2f, 7.1f), GlassCase(b, 4.0f, 7.0f), GlassCase(b, 5.8f, 7.1f);
  GlassCase(b, 0.8f, 5.9f), GlassCase(b, 7.2f, 5.9f), GlassCase(b, 0.8f, 4.4f),
      GlassCase(b, 7.2f, 4.4f);
  for (const Wall wall : {Wall::kLeft, Wall::kRight}) {
    const float start = wall == Wall::kLeft ? 3.9f : 1.2f;
    for (int k = 0; k < 3; ++k) {
      const float along = start + 1.5f * static_cast<float>(k);
      if (k == 1) {
        cv::Mat fossil = DrawFossil(b.random), board(384, 384, CV_8UC3, cv::Scalar(70, 50, 40));
        cv::Mat colour, alpha;
        cv::cvtColor(fossil, colour, cv::COLOR_BGRA2BGR);
        cv::extractChannel(fossil, alpha, 3);
        colour.copyTo(board, alpha);
        b.Hang(wall, along, 0.95f, 1.3f, 1.4f, Bake(board));
      } else {
        b.Hang(wall, along, 1.0f, 0.98f, 1.3f,
               Bake(DrawInfoPanel(b.random, k ? "MINERALS" : "OCEANS")));
      }
    }
  }
  b.Pillar(1.9f, 7.75f), b.Pillar(6.1f, 7.75f);
  b.StandardApproaches(5.4f, kSide, 1.9f, 5.5f, 2.4f, 6.4f);
}

void Desk(RoomBuilder& b, float x, float y) {
  b.Table(x, y, 1.4f, 0.7f);
  b.Box({x, y + 0.15f, 0.82f}, {0.55f, 0.05f, 0.36f}, b.building.black, nullptr, 0,
        Bake(DrawScreen(b.random)));
  b.Box({x, y + 0.15f, 0.74f}, {0.2f, 0.16f, 0.08f}, b.building.metal);
  b.Box({x + 0.5f, y, 0.74f}, {0.22f, 0.3f, 0.12f}, Bake(DrawBooks(b.random)));
  b.Chair(x, y - 0.7f, 3.14f);
}

void Office(RoomBuilder& b) {
  b.Shell(b.building.plaster, 2, 2, Bake(DrawCarpet(b.random, {110, 95, 80})));
  b.SharedArchitecture(2);
  b.Hang(Wall::kBack, 4, 1.0f, 2.8f, 1.4f, Bake(DrawWhiteboard(b.random)));
  b.Shelf(Wall::kLeft, 5.2f, 2.4f, 4, 0.38f, 0.5f, DrawBooks);
  b.Hang(Wall::kRight, 2.6f, 0.9f, 1.8f, 1.2f, Bake(DrawNoticeBoard(b.random)));
  HangPosters(b, Wall::kRight, {4.4f});
  for (const float x : {1.6f, 4.0f, 6.4f}) Desk(b, x, 6.6f);
  b.Plant(7.4f, 7.4f);
  b.StandardApproaches(5.4f, kSide, 1.6f, 5.4f, 2.4f, 6.4f);
}

void Classroom(RoomBuilder& b) {
  b.Shell(Bake(DrawPlaster(b.random, {190, 215, 205})), 2, 2, b.building.wood);
  b.SharedArchitecture(2);
  b.Hang(Wall::kBack, 3.0f, 0.9f, 2.0f, 1.5f, Bake(DrawMenu(b.random, "LESSON")));
  b.Hang(Wall::kBack, 5.6f, 0.9f, 2.4f, 1.5f, Bake(DrawWhiteboard(b.random)));
  b.Hang(Wall::kLeft, 5.2f, 0.9f, 2.6f, 1.8f, Bake(DrawWindow(b.random)), 0.5f);
  b.Hang(Wall::kRight, 2.6f, 0.9f, 2.4f, 1.4f, Bake(DrawNoticeBoard(b.random)));
  for (const float y : {4.6f, 6.2f}) {
    for (const float x : {1.4f, 4.0f, 6.6f}) b.Table(x, y, 1.3f, 0.6f), b.Chair(x, y - 0.6f, 3.14f);
  }
  b.StandardApproaches(5.4f, kSide, 1.8f, 5.4f, 2.4f, 6.6f);
}

void Store(RoomBuilder& b) {
  b.Shell(Bake(DrawBricks(b.random, {150, 160, 165})), 2.0f, 1.2f, b.building.floor, 0.8f);
  b.SharedArchitecture(2);
  for (int i = 0; i < 26; ++i) {
    const float size = static_cast<float>(b.random.Uniform(0.35, 0.6));
    const float x = 0.6f + 0.9f * static_cast<float>(i % 8), z = 0.5f * static_cast<float>(i / 13);
    const TexturePtr& wood =
        b.building.wood_boxes[static_cast<std::size_t>(i) % b.building.wood_boxes.size()];
    b.Box({x, i % 3 ? 7.5f : 6.8f, z}, {size, size, 0.5f}, wood, nullptr,
          static_cast<float>(b.random.Uniform(-0.3, 0.3)));
  }
  b.Shelf(Wall::kLeft, 5.0f, 2.6f, 4, 0.5f, 0.2f, DrawBottles);
  b.Shelf(Wall::kRight, 3.0f, 2.6f, 4, 0.5f, 0.2f, DrawBottles);
  b.Hang(Wall::kBack, 4, 1.7f, 2.0f, 0.4f, Bake(DrawSign("STORE 3", {40, 160, 230}, {20, 20, 20})));
  b.StandardApproaches(5.2f, kSide, 1.6f, 5.4f, 2.4f, 6.4f);
}

void Lockers(RoomBuilder& b) {
  const Building& s = b.building;
  b.Shell(Bake(DrawFloorTiles(b.random, {225, 225, 215}, {200, 190, 150})), 0.8f, 0.8f, s.floor);
  b.SharedArchitecture(2);
  for (const Wall wall : {Wall::kLeft, Wall::kBack, Wall::kRight}) {
    for (int i = 0; i < 8; ++i) {
      const float along = wall == Wall::kBack
                              ? 1.0f + 0.8f * static_cast<float>(i)
                              : (wall == Wall::kLeft ? 3.0f : 1.0f) + 0.5f * static_cast<float>(i);
      cv::Mat locker(256, 96, CV_8UC3,
                     b.random.Chance(0.5) ? cv::Scalar(160, 120, 60) : cv::Scalar(70, 140, 190));
      for (int y = 30; y < 80; y += 12) cv::line(locker, {24, y}, {72, y}, {40, 40, 40}, 4);
      cv::putText(locker, std::to_string(b.random.Below(90) + 10), {26, 130},
                  cv::FONT_HERSHEY_DUPLEX, 1, {250, 250, 250}, 2, cv::LINE_AA);
      cv::rectangle(locker, {0, 0, 96, 256}, {50, 50, 50}, 5);
      b.Hang(wall, along, 0.1f, 0.46f, 1.75f, Bake(locker));
    }
  }
  b.Bench(4, 6.2f, 3.0f, 0.4f);
  HangPosters(b, Wall::kBack, {7.6f}, 1.2f);
  b.StandardApproaches(5.2f, kSide, 1.6f, 5.4f, 2.4f, 6.4f);
}

void Workshop(RoomBuilder& b) {
  b.Shell(Bake(DrawWood(b.random, {120, 150, 175}, 6)), 1.8f, 2.4f, b.building.floor);
  b.SharedArchitecture(2);
  HangPosters(b, Wall::kBack, {1.2f, 6.8f});
  b.Hang(Wall::kBack, 4, 1.0f, 2.4f, 1.6f, Bake(DrawNoticeBoard(b.random)));
  b.Shelf(Wall::kLeft, 5.4f, 1.8f, 5, 0.36f, 0.4f, DrawBottles);
  b.Hang(Wall::kRight, 2.6f, 0.8f, 2.2f, 1.8f, Bake(DrawWindow(b.random)), 0.5f);
  for (const float x : {2.4f, 5.6f}) {
    b.Table(x, 6.4f, 1.8f, 0.8f, 0.85f);
    b.Vase({x - 0.4f, 6.4f, 0.85f}, 0.8f);
    b.Box({x + 0.4f, 6.4f, 0.85f}, {0.4f, 0.3f, 0.3f}, b.building.wood_boxes[1]);
  }
  b.Pillar(1.0f, 3.4f), b.Pillar(7.0f, 3.4f);
  b.StandardApproaches(5.4f, kSide, 1.6f, 5.4f, 2.4f, 6.4f);
}

struct Plan {
  Vector3f size;
  std::function<void(RoomBuilder&)> furnish;
};

const std::map<std::string, Plan>& Plans() {
  static const std::map<std::string, Plan> plans{
      {"cafe", {{8, 8, 3.2f}, Cafe}},
      {"hallway", {{3.4f, 12, 3.0f}, Hallway}},
      {"stairs", {{8, 8.4f, 3.6f}, Stairs}},
      {"lobby", {{9, 9, 3.6f}, Lobby}},
      {"show_window_1", {{8, 7, 3.2f}, [](RoomBuilder& b) { ShowWindow(b, "W 1"); }}},
      {"show_window_2", {{8, 7, 3.2f}, [](RoomBuilder& b) { ShowWindow(b, "W 2"); }}},
      {"book_shelf", {{7, 7, 3.0f}, BookShelf}},
      {"video_room", {{8, 7.6f, 3.2f}, VideoRoom}},
      {"special_room", {{8, 8, 3.2f}, SpecialRoom}},
      {"exhibit", {{8, 8, 3.2f}, Exhibit}},
      {"office", {{8, 8, 3.0f}, Office}},
      {"classroom", {{8, 8, 3.2f}, Classroom}},
      {"store", {{8, 8, 3.2f}, Store}},
      {"lockers", {{8, 8, 3.0f}, Lockers}},
      {"workshop", {{8, 8, 3.2f}, Workshop}}};
  return plans;
}

}  // namespace

Building::Building(std::uint64_t seed) {
  Random random(seed, "building");
  plaster = Bake(DrawPlaster(random, {196, 212, 218}));
  wood = Bake(DrawWood(random, {85, 130, 175}, 4));
  dark_wood = Bake(DrawWood(random, {45, 62, 84}, 2));
  floor = Bake(DrawFloorTiles(random, {190, 202, 208}, {120, 138, 150}));
  ceiling = Bake(DrawCeiling(random));
  marble = Bake(DrawMarble(random, {205, 212, 216}));
  metal = Bake(DrawPlaster(random, {165, 160, 155}));
  white = Bake(DrawPlaster(random, {232, 236, 238}));
  black = Bake(DrawPlainColour({34, 32, 30}));
  lamp = Bake(DrawLamp());
  extinguisher = Bake(DrawExtinguisher());
  exit_sign = Bake(DrawSign("EXIT", {60, 140, 30}, {250, 255, 250}));
  disc_light = Bake(DrawDisc({225, 230, 232}));
  disc_dark = Bake(DrawDisc({40, 52, 70}));
  rug = Bake(DrawCarpet(random, {40, 30, 130}));
  for (int i = 0; i < 4; ++i) doors.push_back(Bake(DrawDoor(random, std::to_string(101 + 7 * i))));
  for (int i = 0; i < 6; ++i) posters.push_back(Bake(DrawPoster(random)));
  for (int i = 0; i < 12; ++i) people.push_back(Bake(DrawPerson(random)));
  for (int i = 0; i < 3; ++i) plants.push_back(Bake(DrawPlant(random)));
  for (int i = 0; i < 3; ++i) wood_boxes.push_back(Bake(DrawWood(random, {90, 140, 180}, 3 + i)));
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

Room BuildRoom(const Building& building, const std::string& name, std::uint64_t seed) {
  const auto plan = Plans().find(name);
  if (plan == Plans().end()) throw ToolError(name + ": no such room");
  const Vector3f& size = plan->second.size;
  Room room{name, size.x(), size.y(), size.z(), {}, {}};
  RoomBuilder builder(building, room, Random(seed, name));
  plan->second.furnish(builder);
  room.scene.BakeLight();
  return room;
}

}  // namespace viewfix::simulation
