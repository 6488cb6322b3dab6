// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/simulation/artwork.h"
#include "firmware_tools/simulation/draw.h"
#include "firmware_tools/simulation/room_builder.h"

namespace viewfix::simulation {
namespace {

float Draw(Random& random, double low, double high) {
  return static_cast<float>(random.Uniform(low, high));
}

cv::Scalar WoodTone(Random& random, double brightness) {
  const double red = random.Uniform(115, 195);
  const double green = red * random.Uniform(0.62, 0.82);
  return Shade({green * random.Uniform(0.5, 0.8), green, red}, brightness);
}

TexturePtr DrawPanels(Random& random, double brightness, int planks) {
  return Bake(DrawWood(random, WoodTone(random, brightness), planks));
}

TexturePtr DrawFlooring(Random& random) {
  const cv::Scalar light = RandomColour(random, 8, 70, 165, 225);
  if (random.Chance(0.3)) return Bake(DrawMarble(random, light));
  return Bake(DrawFloorTiles(random, light, Shade(light, random.Uniform(0.5, 0.85))));
}

TexturePtr DrawExitSign(Random& random) {
  constexpr std::array kTexts{"EXIT", "WAY OUT", "EMERGENCY EXIT", "FIRE EXIT", "SORTIE"};
  const cv::Scalar green(70, random.Uniform(110, 170), 30);
  const cv::Scalar white(250, 255, 250);
  const bool inverse = random.Chance(0.4);
  return Bake(DrawSign(kTexts[random.Below(kTexts.size())], inverse ? white : green,
                       inverse ? green : white));
}

}  // namespace

Covering DrawCovering(Random& random) {
  switch (random.Below(4)) {
    case 0: {
      const float scale = Draw(random, 0.7, 1.4);
      return {Bake(DrawBricks(random, RandomColour(random, 30, 170, 90, 215))), 2.0f * scale,
              1.2f * scale};
    }
    case 1: {
      const float repeat = Draw(random, 1.1, 2.4);
      return {Bake(DrawWallpaper(random, RandomColour(random, 40, 190, 70, 200))), repeat, repeat};
    }
    case 2:
      return {DrawPanels(random, 1, 4 + random.Below(7)), Draw(random, 1.2, 2.4),
              Draw(random, 1.8, 3)};
    default:
      return {Bake(DrawPlaster(random, RandomColour(random, 20, 110, 140, 230))), 2, 2};
  }
}

Fashion::Fashion(Random& random) {
  const bool light_signs = random.Chance(0.5);
  const cv::Scalar dark = RandomColour(random, 80, 230, 40, 140);
  const cv::Scalar light = RandomColour(random, 0, 60, 225, 255);
  sign_ground = light_signs ? light : dark;
  sign_ink = light_signs ? dark : light;
  skirting = Draw(random, 0.06, 0.18);
  door_width = Draw(random, 0.85, 1.25);
  door_height = Draw(random, 1.98, 2.2);
  ceiling_repeat = Draw(random, 0.9, 1.8);
  floor_repeat = Draw(random, 1.5, 3.6);
  lamp_length = Draw(random, 0.5, 1.4);
  lamp_width = Draw(random, 0.2, 0.5);
  lamp_pitch = Draw(random, 1.9, 2.9);
  lamp_rows = 2 + random.Below(2);
  lamps_along = random.Chance(0.5);
  pillar_radius = Draw(random, 0.14, 0.25);
  pillar_faces = random.Chance(0.4) ? 4 : 12;
  table_height = Draw(random, 0.68, 0.8);
  table_leg = Draw(random, 0.035, 0.08);
  seat_height = Draw(random, 0.38, 0.48);
  seat_back = Draw(random, 0.28, 0.55);
  shelf_depth = Draw(random, 0.26, 0.4);
  shelf_board = Draw(random, 0.02, 0.045);
  for (float& radius : vase) radius = Draw(random, 0.35, 1);
}

Building::Building(std::uint64_t seed) : Building(Random(seed, "building")) {}

Building::Building(Random random) : fashion(random) {
  const cv::Scalar pale = RandomColour(random, 4, 50, 185, 235);
  plaster = Bake(DrawPlaster(random, pale));
  wood = DrawPanels(random, 1, 3 + random.Below(4));
  dark_wood = DrawPanels(random, 0.5, 2);
  floor = DrawFlooring(random);
  ceiling = Bake(DrawCeiling(random));
  marble = Bake(DrawMarble(random, RandomColour(random, 4, 40, 170, 225)));
  metal = Bake(DrawPlaster(random, RandomColour(random, 2, 20, 110, 190)));
  white = Bake(DrawPlaster(random, {232, 236, 238}));
  black = Bake(DrawPlainColour({34, 32, 30}));
  lamp = Bake(DrawLamp(random));
  exit_sign = DrawExitSign(random);
  disc_light = Bake(DrawDisc({225, 230, 232}));
  disc_dark = Bake(DrawDisc({40, 52, 70}));
  rug = Bake(DrawCarpet(random, RandomColour(random, 120, 220, 60, 150)));
  const Random door_design = random;
  const cv::Scalar door_wood = WoodTone(random, 0.9);
  const int first_number = 100 + random.Below(300);
  const int number_step = 1 + random.Below(9);
  for (int i = 0; i < 4; ++i) {
    doors.push_back(Bake(
        DrawDoor(random, door_design, door_wood, std::to_string(first_number + number_step * i))));
  }
  for (int i = 0; i < 6; ++i) posters.push_back(Bake(DrawPoster(random)));
  for (int i = 0; i < 12; ++i) people.push_back(Bake(DrawPerson(random)));
  for (int i = 0; i < 3; ++i) plants.push_back(Bake(DrawPlant(random)));
  for (int i = 0; i < 3; ++i) wood_boxes.push_back(DrawPanels(random, 1, 3 + i));
  coverings.push_back({plaster, 2, 2});
  for (int i = 0; i < 3; ++i) coverings.push_back(DrawCovering(random));
  extinguisher = Bake(DrawExtinguisher(random));
}

}  // namespace viewfix::simulation
