// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <opencv2/imgproc.hpp>

#include "firmware_tools/simulation/draw.h"
#include "firmware_tools/simulation/rooms.h"

namespace viewfix::simulation {
namespace {

using Eigen::Vector3f;

// `kind` or a word of this building's own, so that no two museums have the same signs.
std::string Title(Random& random, const std::string& kind) {
  const std::string word = RandomWord(random);
  return Capitals(random.Chance(0.5) ? kind + " " + word : word + " " + kind);
}

// A counter before the back wall, its top not yet laden.
struct Counter {
  float x, y, width, depth, height;

  // The middle of one of `parts` equal lengths of it.
  Vector3f Top(int part, int parts) const {
    const float share = (static_cast<float>(part) + 0.5f) / static_cast<float>(parts) - 0.5f;
    return {x + share * width, y, height + 0.06f};
  }
};

Counter PutCounter(RoomBuilder& b, const TexturePtr& sides) {
  Counter c{};
  c.width = std::min(b.Draw(2.6, 4.6), b.width() - 1.4f);
  c.depth = b.Draw(0.5, 0.8);
  c.height = b.Draw(0.9, 1.15);
  c.x = b.Draw(double{c.width / 2 + 0.3f}, double{b.width() - c.width / 2 - 0.3f});
  c.y = b.depth() - b.Draw(1.1, 1.4);
  b.Box({c.x, c.y, 0}, {c.width, c.depth, c.height}, sides);
  b.Box({c.x, c.y, c.height}, {c.width + 0.2f, c.depth + 0.15f, 0.06f}, b.building.marble);
  const float front = c.y - c.depth / 2 - 0.1f;
  b.Occupy(c.x, (front + b.depth()) / 2, c.width + 0.2f, b.depth() - front);
  return c;
}

void SetTable(RoomBuilder& b, float x, float y, float size) {
  const float top = b.building.fashion.table_height;
  b.Table(x, y, size, size);
  const float out = size / 2 + 0.2f;
  const float turn = b.Draw(-0.3, 0.3);
  b.Chair(x, y + out, turn), b.Chair(x, y - out, 3.14f + turn);
  for (int i = 0; i < 3; ++i) {
    const float part = 0.35f * size;
    const float cup_y = y + b.Draw(-part, part), cup_x = x + b.Draw(-part, part);
    const Vector3f at(cup_x, cup_y, top);
    b.Cylinder(at, 0.08f, 0.012f, b.building.white, b.building.disc_light, 8);
    b.Cylinder(at, 0.04f, 0.09f, b.building.white, b.building.disc_dark, 8);
  }
  b.Box({x, y, top}, {0.14f, 0.06f, 0.2f}, Bake(DrawMenu(b.random, RandomWord(b.random))));
}

void LadeCafeCounter(RoomBuilder& b, const Counter& counter) {
  const Building& s = b.building;
  const int first = b.Count(0, 2);
  const auto part = [&](int i) { return counter.Top((first + i) % 3, 3); };
  const float share = counter.width / 3;
  b.Box(part(0), {share * b.Draw(0.4, 0.7), 0.42f, b.Draw(0.35, 0.55)}, s.metal, s.metal, 0,
        Bake(DrawScreen(b.random)));
  b.Box(part(1), {share * b.Draw(0.6, 0.95), 0.42f, b.Draw(0.3, 0.45)}, Bake(DrawBottles(b.random)),
        s.white);
  for (int cup = b.Count(4, 8); cup > 0; --cup) {
    const float off_y = b.Draw(-0.18, 0.18), off_x = share * b.Draw(-0.4, 0.4);
    const Vector3f off(off_x, off_y, 0);
    b.Cylinder(part(2) + off, 0.05f, 0.11f, s.white, s.disc_dark, 8);
  }
}

WallThing Window(RoomBuilder& b) {
  const float width = b.Draw(1.5, 2.6);
  return b.Picture(width, b.Draw(1.3, 1.9), 0.8f, Bake(DrawWindow(b.random)), 0.5f);
}

void LayRug(RoomBuilder& b) {
  const float x = b.width() * b.Draw(0.4, 0.6), y = b.depth() * b.Draw(0.5, 0.65);
  const float width = b.Draw(2.4, 3.8), depth = b.Draw(1.6, 2.6);
  b.FloorPatch(x, y, width, depth, Bake(DrawRug(b.random)));
}

}  // namespace

void Cafe(RoomBuilder& b) {
  b.Approaches();
  OwnShell(b);
  const int planks = 4 + b.random.Below(6);
  const Counter counter =
      PutCounter(b, Bake(DrawWood(b.random, RandomColour(b.random, 60, 150, 80, 170), planks)));
  LadeCafeCounter(b, counter);
  b.Sign(Wall::kBack, counter.x + b.Draw(-1.5, 1.5), Title(b.random, "CAFE"));
  std::vector<WallThing> back;
  for (int i = b.Count(2, 4); i > 0; --i) {
    const std::string title = Capitals(RandomWord(b.random));
    back.push_back(b.Picture(1.0f, 1.2f, 1.35f, Bake(DrawMenu(b.random, title))));
  }
  b.SpreadBack(std::move(back), 2);
  std::vector<WallThing> sides{b.Shelves(2.2f, 4, 0.42f, DrawBottles), Window(b)};
  if (b.Count(0, 1)) sides.push_back(Window(b));
  b.SpreadSides(std::move(sides));
  const float size = b.Draw(0.65, 0.95);
  b.Scatter(b.Count(3, 5), size + 0.1f, size + 0.9f,
            [&](float x, float y) { SetTable(b, x, y, size); });
  b.Scatter(b.Count(1, 3), 0.8f, 0.8f, [&](float x, float y) { b.Plant(x, y); });
}

void Hallway(RoomBuilder& b) {
  b.Approaches(0.62f);
  b.Shell(b.building.coverings[0], b.building.floor);
  std::vector<WallThing> sides{
      b.Door(), b.Picture(1.8f, 1.2f, 0.9f, Bake(DrawNoticeBoard(b.random))), b.Door(),
      b.Picture(1.6f, 1.07f, 0.95f, Bake(DrawFloorPlan(b.random)))};
  for (int i = b.Count(1, 4); i > 0; --i) sides.push_back(b.Poster());
  b.SpreadSides(std::move(sides));
  b.SpreadBack({b.Picture(1.7f, 1.5f, 0.7f, Bake(DrawWindow(b.random)), 0.6f)}, 2);
  b.Sign(Wall::kBack, b.width() / 2, Title(b.random, "ROOMS"));
  const float length = b.Draw(1.1, 1.7);
  b.Scatter(b.Count(1, 2), 0.45f, length, [&](float x, float y) { b.Bench(x, y, 0.4f, length); });
  b.Scatter(b.Count(1, 2), 0.7f, 0.7f, [&](float x, float y) { b.Plant(x, y); });
}

namespace {

struct Flight {
  float x, width, front, going, rise;
  int steps;
};

Flight DrawFlight(RoomBuilder& b) {
  Flight f{};
  f.width = b.Draw(1.9, 3.0);
  f.x = b.Draw(double{f.width / 2 + 1.2f}, double{b.width() - f.width / 2 - 1.2f});
  f.going = b.Draw(0.26, 0.31);
  f.rise = b.Draw(0.15, 0.19);
  f.steps = b.Count(8, 11);
  f.front = b.depth() - f.going * static_cast<float>(f.steps) - b.Draw(0.3, 0.6);
  return f;
}

void PutFlight(RoomBuilder& b, const Flight& f) {
  const Building& s = b.building;
  const TexturePtr riser = Bake(DrawMarble(b.random, RandomColour(b.random, 10, 60, 110, 190)));
  for (int i = 0; i < f.steps; ++i) {
    const float y0 = f.front + f.going * static_cast<float>(i);
    const float length = b.depth() - y0, z = f.rise * static_cast<float>(i);
    b.Box({f.x, y0 + length / 2, z}, {f.width, length, f.rise}, riser, s.marble);
    b.Box({f.x, y0 + 0.015f, z + f.rise - 0.02f}, {f.width + 0.02f, 0.04f, 0.025f}, s.black);
    for (const float side : {-0.5f, 0.5f}) {
      const Vector3f post(f.x + side * (f.width - 0.1f), y0 + f.going / 2, z + f.rise);
      b.Cylinder(post, 0.022f, 0.85f, s.metal, nullptr, 6);
      b.Box(post + Vector3f(0, 0, 0.85f), {0.07f, f.going + 0.02f, 0.12f}, s.wood);
    }
  }
  b.Occupy(f.x, (f.front + b.depth()) / 2, f.width + 0.1f, b.depth() - f.front);
}

}  // namespace

void Stairs(RoomBuilder& b) {
  b.Approaches();
  b.Shell(RoomWalls(b), b.building.floor);
  const Flight flight = DrawFlight(b);
  PutFlight(b, flight);
  const float landing = flight.rise * static_cast<float>(flight.steps);
  const float width = b.Draw(1.1, 1.6), height = b.Draw(0.6, 0.9);
  b.Hang(Wall::kBack, flight.x, landing + 0.35f, width, height, Bake(DrawPainting(b.random)));
  const float left = flight.x - flight.width / 2, right = flight.x + flight.width / 2;
  b.Spread(Wall::kBack, 0.1f, left,
           {b.Poster(), b.Picture(1.5f, 1.0f, 1.2f, Bake(DrawFloorPlan(b.random))), b.Poster()});
  b.Spread(Wall::kBack, right, b.width() - 0.1f,
           {b.Poster(), b.Picture(1.1f, 1.5f, 0.9f, Bake(DrawPainting(b.random))), b.Poster()});
  const std::string floor_number = std::to_string(b.random.Below(9));
  const float lift_width = b.Draw(1.1, 1.6), lift_height = b.Draw(2.0, 2.3);
  const WallThing lift{lift_width, [&](Wall wall, float along) {
                         b.Hang(wall, along, 0, lift_width, lift_height, b.building.metal);
                         b.Sign(wall, along, "LIFT " + floor_number, lift_width);
                       }};
  const cv::Mat level = DrawSign(Title(b.random, floor_number), b.building.fashion.sign_ink,
                                 b.building.fashion.sign_ground);
  b.SpreadSides({lift, Window(b), b.Picture(1.8f, 0.4f, 1.5f, Bake(level))});
  b.Scatter(b.Count(1, 3), 0.8f, 0.8f, [&](float x, float y) { b.Plant(x, y); });
  b.Scatter(b.Count(1, 2), 0.5f, 1.7f, [&](float x, float y) { b.Bench(x, y, 0.45f, 1.6f); });
}

void Lobby(RoomBuilder& b) {
  const Building& s = b.building;
  b.Approaches();
  b.Shell(s.coverings[0], s.marble);
  const int planks = 3 + b.random.Below(6);
  const Counter desk =
      PutCounter(b, Bake(DrawWood(b.random, RandomColour(b.random, 50, 150, 70, 150), planks)));
  const cv::Mat board =
      DrawSign(Title(b.random, "DESK"), s.fashion.sign_ground, s.fashion.sign_ink);
  const float board_width = std::min(desk.width - 0.2f, b.Draw(1.5, 2.5));
  const float board_height = b.Draw(0.25, 0.4);
  b.Box({desk.x, desk.y - desk.depth / 2 - 0.01f, desk.height * 0.4f},
        {board_width, 0.02f, board_height}, s.metal, nullptr, 0, Bake(board));
  const Vector3f screen = desk.Top(b.Count(0, 3), 4);
  b.Box(screen, {b.Draw(0.4, 0.6), 0.06f, b.Draw(0.28, 0.38)}, s.black, s.black, 0,
        Bake(DrawScreen(b.random)));
  b.Sign(Wall::kBack, desk.x, Title(b.random, "MUSEUM"));
  b.SpreadBack({b.Picture(1.4f, 0.8f, 1.35f, Bake(DrawScreen(b.random)), 0.6f)}, 3);
  b.SpreadSides({Window(b), b.Picture(2.1f, 1.4f, 0.9f, Bake(DrawFloorPlan(b.random))), Window(b)});
  b.Scatter(b.Count(2, 4), 0.7f, 0.7f, [&](float x, float y) { b.Pillar(x, y); });
  LayRug(b);
  const float length = b.Draw(1.3, 2.0);
  b.Scatter(b.Count(1, 3), 0.7f, length, [&](float x, float y) { b.Bench(x, y, 0.65f, length); });
  b.Scatter(b.Count(1, 3), 0.8f, 0.8f, [&](float x, float y) { b.Plant(x, y); });
}

namespace {

// What both show windows have: drawn from the stream that they share.
struct ShopFittings {
  TexturePtr panel, backdrop, hours, sale;

  explicit ShopFittings(Random& random) {
    const int planks = 4 + random.Below(5);
    panel = Bake(DrawWood(random, RandomColour(random, 60, 150, 110, 210), planks));
    backdrop = Bake(DrawWallpaper(random, RandomColour(random, 40, 180, 70, 190)));
    const std::string title = Title(random, "OPEN");
    hours = Bake(DrawInfoPanel(random, title));
    sale = Bake(DrawPoster(random));
  }
};

// Half of the goods are the same in both windows.
cv::Mat Dress(RoomBuilder& b, bool shared) { return DrawMannequin(shared ? b.layout : b.random); }

void FrontWindow(RoomBuilder& b, const ShopFittings& fittings) {
  const Building& s = b.building;
  const float width = b.width() * b.Draw(0.6, 0.75), depth = b.Draw(0.7, 1.0);
  const float x0 = b.width() * b.Draw(0.46, 0.54) - width / 2, base = b.Draw(0.25, 0.5);
  const float middle = x0 + width / 2, y = b.depth() - 0.2f - depth / 2, rise = b.Draw(1.85, 2.05);
  b.Hang(Wall::kBack, middle, base, width - 0.1f, rise, fittings.backdrop, 0.12f);
  b.Box({middle, y, 0}, {width, depth, base}, fittings.panel, s.marble);
  b.Occupy(middle, y, width, depth + 0.4f);
  const int panes = b.Count(2, 4);
  const float glass = y - depth / 2 + 0.05f;
  for (int i = 0; i <= panes; ++i) {
    const float share = static_cast<float>(i) / static_cast<float>(panes);
    b.Box({x0 + 0.04f + share * (width - 0.08f), glass, base}, {0.08f, 0.08f, rise}, s.metal);
  }
  b.Box({middle, glass, base + rise}, {width, 0.1f, 0.12f}, s.metal);
  const int goods = b.Count(3, 5);
  for (int i = 0; i < goods; ++i) {
    const float place = (static_cast<float>(i) + b.Draw(0.2, 0.5)) / static_cast<float>(goods);
    const Vector3f at(x0 + place * width, y + b.Draw(0, 0.2), base);
    const float size = b.Draw(0.85, 1.05), turn = b.Draw(-0.3, 0.3);
    b.CutOut(at, 0.62f * size, 1.75f * size, Bake(Dress(b, i % 2 == 0)), false, turn);
    b.Vase(at + Vector3f(0.5f, -0.1f, 0), b.Draw(0.7, 1.2));
  }
}

// A smaller window in a side wall.
WallThing SideWindow(RoomBuilder& b, const ShopFittings& fittings) {
  const float width = b.Draw(2.0, 2.8), base = b.Draw(0.4, 0.7), out = 0.6f;
  const float scale = b.Draw(0.9, 1.2);
  const int mannequin = b.Count(0, 2);
  return {width, [=, &b](Wall wall, float along) {
            b.Hang(wall, along, base, width - 0.1f, 1.7f, fittings.backdrop, 0.12f);
            const Vector3f box = b.OnWall(wall, along, 0, out / 2);
            b.Box(box, {out, width, base}, fittings.panel, b.building.marble);
            b.Occupy(box.x(), box.y(), out, width);
            for (int i = 0; i < 3; ++i) {
              const float off = (static_cast<float>(i) - 1) * width / 3.2f;
              const Vector3f at = b.OnWall(wall, along + off, base, 0.25f);
              if (i == mannequin) {
                b.CutOut(at, 0.56f, 1.6f, Bake(Dress(b, false)), false, 1.57f);
              } else {
                b.Vase(at, scale);
              }
            }
          }};
}

}  // namespace

void ShowWindow(RoomBuilder& b, int number) {
  b.Approaches();
  const ShopFittings fittings(b.layout);
  b.Shell({fittings.panel, b.Draw(1.3, 2.0), b.Draw(2.0, 2.8)}, b.building.floor);
  FrontWindow(b, fittings);
  const std::string shop = Title(b.layout, "SHOP");
  b.Sign(Wall::kBack, b.width() * b.Draw(0.4, 0.6), shop);
  const WallThing first = SideWindow(b, fittings), second = SideWindow(b, fittings);
  const WallThing hours = b.Picture(0.75f, 1.0f, 0.9f, fittings.hours);
  const WallThing sale = b.Picture(0.72f, 1.04f, 0.95f, fittings.sale);
  b.SpreadSides({first, second, hours, sale, hours});
  const cv::Mat plate =
      DrawSign(RandomWord(b.layout) + " " + std::to_string(number), {240, 240, 240}, {30, 30, 30});
  b.Hang(Wall::kBack, 0.45f, b.Draw(1.5, 1.9), 0.6f, 0.25f, Bake(plate));
}

namespace {

// Shelves under a sign with their subject.
WallThing Subject(RoomBuilder& b, int boards) {
  const WallThing shelves = b.Shelves(1.9f, boards, 0.38f, DrawBooks);
  const std::string subject = Capitals(RandomWord(b.random));
  return {shelves.width, [=, &b](Wall wall, float along) {
            shelves.put(wall, along);
            b.Sign(wall, along, subject, shelves.width);
          }};
}

void ReadingTable(RoomBuilder& b, float x, float y, float width) {
  const float top = b.building.fashion.table_height;
  b.Table(x, y, width, 0.8f), b.Chair(x - 0.4f, y + 0.6f, 0), b.Chair(x + 0.4f, y - 0.6f, 3.14f);
  const int books = b.Count(2, 5);
  for (int i = 0; i < books; ++i) {
    const float share = (static_cast<float>(i) + 0.5f) / static_cast<float>(books) - 0.5f;
    const float thick = b.Draw(0.04, 0.12), turn = b.Draw(-0.6, 0.6);
    const TexturePtr pages = Bake(DrawBooks(b.random));
    b.Box({x + share * width, y, top}, {0.2f, 0.27f, thick}, pages, b.StockPoster(), turn);
  }
}

}  // namespace

void BookShelf(RoomBuilder& b) {
  b.Approaches();
  OwnShell(b);
  std::vector<WallThing> back;
  for (int i = b.Count(2, 3); i > 0; --i) back.push_back(Subject(b, 6));
  b.SpreadBack(std::move(back), 2);
  std::vector<WallThing> sides;
  for (int i = b.Count(3, 5); i > 0; --i) sides.push_back(Subject(b, 6));
  b.SpreadSides(std::move(sides));
  const float width = b.Draw(1.3, 2.0);
  b.Scatter(b.Count(1, 2), width, 1.8f, [&](float x, float y) { ReadingTable(b, x, y, width); });
  b.Scatter(b.Count(1, 3), 0.6f, 0.6f, [&](float x, float y) {
    b.Box({x, y, 0}, {0.5f, 0.4f, 0.45f}, b.building.wood);
  });
}

void VideoRoom(RoomBuilder& b) {
  b.Approaches();
  OwnShell(b, 0.55f);
  const auto screen = [&](float width) {
    const float bottom = b.Draw(0.8, 1.3);
    return b.Picture(width, width * 0.5625f, bottom, Bake(DrawScreen(b.random)), 0.5f);
  };
  std::vector<WallThing> back{screen(b.Draw(2.4, 3.4))};
  for (int i = b.Count(1, 3); i > 0; --i) back.push_back(screen(1.3f));
  b.SpreadBack(std::move(back), 1);
  b.Sign(Wall::kBack, b.width() * b.Draw(0.3, 0.7), Title(b.random, "VIDEO"));
  std::vector<WallThing> sides;
  for (int i = b.Count(5, 7); i > 0; --i) {
    sides.push_back(screen(1.4f));
    const std::string title = std::to_string(i) + " " + RandomWord(b.random);
    sides.push_back(b.Picture(0.5f, 0.66f, 0.9f, Bake(DrawInfoPanel(b.random, title))));
  }
  b.SpreadSides(std::move(sides));
  const float length = b.Draw(1.4, 2.4);
  b.Scatter(b.Count(2, 4), length, 0.5f, [&](float x, float y) { b.Bench(x, y, length, 0.45f); });
  b.Scatter(b.Count(1, 2), 0.5f, 0.5f, [&](float x, float y) {
    b.Box({x, y, 0}, {0.4f, 0.4f, 0.75f}, b.building.black);
  });
}

void SpecialRoom(RoomBuilder& b) {
  b.Approaches();
  OwnShell(b);
  const auto painting = [&] {
    const float width = b.Draw(1.0, 2.0);
    return b.Picture(width, b.Draw(1.0, 1.6), 0.95f, Bake(DrawPainting(b.random)));
  };
  std::vector<WallThing> back, sides;
  for (int i = b.Count(3, 4); i > 0; --i) back.push_back(painting());
  for (int i = b.Count(5, 7); i > 0; --i) {
    sides.push_back(painting());
    const std::string title = RandomWord(b.random);
    sides.push_back(b.Picture(0.3f, 0.4f, 1.0f, Bake(DrawInfoPanel(b.random, title))));
  }
  b.SpreadBack(std::move(back), 0);
  b.SpreadSides(std::move(sides));
  LayRug(b);
  b.Scatter(b.Count(2, 4), 0.7f, 0.7f, [&](float x, float y) {
    const float height = b.Draw(0.8, 1.15);
    b.Plinth(x, y, height), b.Vase({x, y, height}, b.Draw(0.8, 1.2));
  });
  b.Scatter(b.Count(1, 3), 0.3f, 1.7f, [&](float x, float y) { b.Rope(x, y - 0.7f, x, y + 0.7f); });
  b.Scatter(b.Count(0, 2), 1.7f, 0.3f, [&](float x, float y) { b.Rope(x - 0.7f, y, x + 0.7f, y); });
}

namespace {

struct CaseSize {
  float width, depth, base, glass;
};

void GlassCase(RoomBuilder& b, float x, float y, const CaseSize& size) {
  const Building& s = b.building;
  b.Box({x, y, 0}, {size.width, size.depth, size.base}, s.white, s.marble);
  for (const float side_x : {-0.5f, 0.5f}) {
    for (const float side_y : {-0.5f, 0.5f}) {
      b.Box({x + side_x * (size.width - 0.04f), y + side_y * (size.depth - 0.04f), size.base},
            {0.025f, 0.025f, size.glass}, s.metal);
    }
  }
  b.Box({x, y, size.base + size.glass}, {size.width, size.depth, 0.04f}, s.metal);
  const float side = b.Count(0, 1) ? 1.0f : -1.0f;
  b.CutOut({x - side * 0.2f * size.width, y, size.base + 0.02f}, 0.5f, 0.5f,
           Bake(DrawFossil(b.random)), false, b.Draw(-0.4, 0.4));
  b.Vase({x + side * 0.26f * size.width, y, size.base}, 0.7f);
  const std::string label =
      Capitals(RandomWord(b.random)) + " " + std::to_string(b.random.Below(90));
  b.Box({x, y - size.depth / 2 - 0.01f, size.base * 0.65f}, {0.5f, 0.02f, 0.2f}, s.metal, nullptr,
        0, Bake(DrawSign(label, {235, 240, 240}, {30, 30, 30})));
}

TexturePtr FossilBoard(Random& random) {
  const cv::Mat fossil = DrawFossil(random);
  cv::Mat board(fossil.size(), CV_8UC3, RandomColour(random, 30, 150, 40, 110));
  cv::Mat colour, alpha;
  cv::cvtColor(fossil, colour, cv::COLOR_BGRA2BGR);
  cv::extractChannel(fossil, alpha, 3);
  colour.copyTo(board, alpha);
  return Bake(board);
}

WallThing Panel(RoomBuilder& b) {
  const std::string title = Capitals(RandomWord(b.random));
  return b.Picture(1.05f, 1.4f, 0.9f, Bake(DrawInfoPanel(b.random, title)));
}

}  // namespace

void Exhibit(RoomBuilder& b) {
  b.Approaches();
  b.Shell(RoomWalls(b), b.building.floor);
  b.Sign(Wall::kBack, b.width() * b.Draw(0.35, 0.65), Title(b.random, "FOSSILS"));
  std::vector<WallThing> back, sides;
  for (int i = b.Count(3, 5); i > 0; --i) back.push_back(Panel(b));
  for (int i = b.Count(2, 4); i > 0; --i) {
    sides.push_back(Panel(b));
    sides.push_back(b.Picture(1.3f, 1.4f, 0.9f, FossilBoard(b.random)));
  }
  b.SpreadBack(std::move(back), 0);
  b.SpreadSides(std::move(sides));
  const CaseSize size{b.Draw(0.85, 1.2), b.Draw(0.5, 0.7), b.Draw(0.8, 0.95), b.Draw(0.6, 0.8)};
  b.Scatter(b.Count(5, 7), size.width + 0.1f, size.depth + 0.15f,
            [&](float x, float y) { GlassCase(b, x, y, size); });
  b.Scatter(b.Count(0, 2), 0.7f, 0.7f, [&](float x, float y) { b.Pillar(x, y); });
}

}  // namespace viewfix::simulation
