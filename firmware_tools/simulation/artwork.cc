// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/simulation/artwork.h"

#include <algorithm>
#include <array>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "firmware_tools/simulation/draw.h"

namespace viewfix::simulation {
namespace {

const cv::Scalar kWhite(245, 247, 248), kInk(40, 36, 34);

cv::Mat Transparent(cv::Size size, cv::Scalar colour) {
  return cv::Mat(size, CV_8UC4, cv::Scalar(colour[0], colour[1], colour[2], 0));
}

cv::Scalar Opaque(const cv::Scalar& colour) { return {colour[0], colour[1], colour[2], 255}; }

std::string Price(Random& random) {
  return std::to_string(2 + random.Below(9)) + "." + std::to_string(10 + random.Below(90));
}

}  // namespace

cv::Mat DrawPoster(Random& random) {
  cv::Mat image(576, 400, CV_8UC3, RandomColour(random, 0, 160, 170, 255));
  const bool picture_above = random.Chance(0.6);
  const int picture_height = 220 + random.Below(120);
  const cv::Rect picture(24, picture_above ? 24 : 540 - picture_height, 352, picture_height);
  PaintScenery(image, random, picture);
  const cv::Scalar title = RandomColour(random, 120, 255, 20, 120);
  int y = picture_above ? picture.br().y + 56 : 64;
  const int end = picture_above ? 560 : picture.y - 8;
  Write(image, RandomPhrase(random, 1 + random.Below(2)), {24, y}, 40, title, 352, true);
  Write(image, RandomPhrase(random, 2), {24, y += 38}, 18, kInk, 352, true);
  WriteParagraph(image, random, {24, y + 6, 352, end - y - 6}, 9, kInk);
  cv::rectangle(image, {0, 0, 400, 576}, RandomColour(random, 0, 255, 30, 90), 8);
  return image;
}

cv::Mat DrawPainting(Random& random) {
  const cv::Size size = random.Chance(0.5) ? cv::Size(640, 480) : cv::Size(480, 600);
  cv::Mat image(size, CV_8UC3, cv::Scalar(52, 110, 150));
  const cv::Scalar gilding = RandomColour(random, 20, 180, 60, 190);
  for (int ring = 0; ring < 5; ++ring) {
    cv::rectangle(image, {ring * 8, ring * 8, size.width - ring * 16, size.height - ring * 16},
                  Shade(gilding, random.Uniform(0.5, 1.4)), 8);
  }
  const int step = 20 + random.Below(60), bead = 4 + random.Below(7);
  for (int x = step / 2; x < size.width; x += step) {
    cv::circle(image, {x, 20}, bead, Shade(gilding, 1.5), 2, cv::LINE_AA);
    cv::circle(image, {x, size.height - 20}, bead, Shade(gilding, 1.5), 2, cv::LINE_AA);
  }
  const cv::Rect canvas(42, 42, size.width - 84, size.height - 84);
  PaintScenery(image, random, canvas);
  if (random.Chance(0.5)) {  // a sitter
    const cv::Point head(size.width / 2 + random.Below(40) - 20, size.height * 2 / 5);
    cv::Mat part = image(canvas);
    const cv::Point in_part = head - canvas.tl();
    cv::ellipse(part, in_part + cv::Point(0, 190), {130, 140}, 0, 180, 360,
                RandomColour(random, 60, 220, 30, 140), cv::FILLED, cv::LINE_AA);
    cv::ellipse(part, in_part + cv::Point(0, -16), {62, 78}, 0, 0, 360,
                RandomColour(random, 60, 160, 20, 90), cv::FILLED, cv::LINE_AA);
    cv::ellipse(part, in_part, {48, 64}, 0, 0, 360, {150, 185, 228}, cv::FILLED, cv::LINE_AA);
    for (const int side : {-18, 18}) {
      cv::ellipse(part, in_part + cv::Point(side, -8), {8, 4}, 0, 0, 360, {40, 50, 60}, cv::FILLED,
                  cv::LINE_AA);
    }
    cv::ellipse(part, in_part + cv::Point(0, 32), {16, 5}, 0, 0, 180, {70, 70, 160}, 3,
                cv::LINE_AA);
  }
  return image;
}

cv::Mat DrawBooks(Random& random) {
  constexpr int kHeight = 160;
  cv::Mat image(kHeight, 600, CV_8UC3, cv::Scalar(22, 26, 30));
  for (int x = 2; x < image.cols;) {
    const int width = 9 + random.Below(22), height = kHeight * 60 / 100 + random.Below(kHeight / 3);
    const cv::Scalar colour = RandomColour(random, 40, 230, 50, 235);
    const cv::Scalar ink = cv::sum(colour)[0] > 640 ? kInk : Shade({200, 230, 240}, 1);
    cv::Mat spine(width, height, CV_8UC3, colour);  // lying, so that its title can be written
    for (int band = random.Below(4); band > 0; --band) {
      const int at = random.Below(height);
      cv::line(spine, {at, 0}, {at, width}, RandomColour(random, 0, 255, 60, 255),
               1 + random.Below(5));
    }
    Write(spine, RandomPhrase(random, 1 + random.Below(2)), {height / 8, width * 7 / 10},
          width * 0.42, ink, height * 3 / 4);
    spine.row(0) = Shade(colour, 0.5);
    spine.row(width - 1) = Shade(colour, 0.6);
    cv::rotate(spine, spine, cv::ROTATE_90_CLOCKWISE);
    const int visible = std::min(width, image.cols - x);
    spine.colRange(0, visible).copyTo(image(cv::Rect(x, kHeight - height, visible, height)));
    x += width + (random.Chance(0.06) ? random.Below(26) : 1);
  }
  return image;
}

cv::Mat DrawBottles(Random& random) {
  cv::Mat image(200, 600, CV_8UC3, cv::Scalar(40, 52, 66));
  for (int x = 6; x < 580;) {
    const int width = 24 + random.Below(26), height = 70 + random.Below(100);
    const cv::Scalar colour = RandomColour(random, 60, 230, 50, 220);
    const int neck = random.Chance(0.6) ? height / 3 : 0;
    cv::rectangle(image, {x, 200 - height + neck, width, height - neck}, colour, cv::FILLED);
    cv::rectangle(image, {x + width / 3, 200 - height, width / 3, neck + 4}, Shade(colour, 0.8),
                  cv::FILLED);
    cv::line(image, {x + width / 5, 200 - height + neck}, {x + width / 5, 198}, Shade(colour, 1.6),
             3);
    const cv::Rect label(x + 2, 200 - (height - neck) * 3 / 4, width - 4, (height - neck) / 2);
    cv::rectangle(image, label, RandomColour(random, 0, 120, 180, 255), cv::FILLED);
    Write(image, RandomWord(random), {label.x + 2, label.y + label.height * 2 / 3}, 8, kInk,
          label.width - 4);
    x += width + 2 + random.Below(14);
  }
  return image;
}

cv::Mat DrawScreen(Random& random) {
  cv::Mat image(360, 640, CV_8UC3);
  PaintScenery(image, random, {0, 0, 640, 360});
  const int style = random.Below(3);
  if (style == 0) {  // news with a ticker
    cv::rectangle(image, {0, 290, 640, 70}, RandomColour(random, 180, 255, 60, 160), cv::FILLED);
    Write(image, RandomPhrase(random, 4), {20, 322}, 22, kWhite, 600, true);
    Write(image, RandomPhrase(random, 8), {20, 350}, 14, kWhite, 600);
  } else if (style == 1) {  // a chart
    cv::rectangle(image, {40, 30, 560, 290}, {50, 42, 36}, cv::FILLED);
    for (int i = 0; i < 12; ++i) {
      const int height = 30 + random.Below(200);
      cv::rectangle(image, {64 + i * 44, 300 - height, 30, height},
                    RandomColour(random, 150, 255, 150, 255), cv::FILLED);
    }
    Write(image, RandomPhrase(random, 3), {60, 62}, 22, kWhite, 500, true);
  } else {  // a film with a subtitle
    cv::rectangle(image, {0, 0, 640, 36}, {8, 8, 8}, cv::FILLED);
    cv::rectangle(image, {0, 324, 640, 36}, {8, 8, 8}, cv::FILLED);
    Write(image, RandomPhrase(random, 5), {80, 312}, 22, {60, 240, 250}, 480, true);
  }
  cv::rectangle(image, {0, 0, 640, 360}, {18, 18, 18}, 18);
  return image;
}

cv::Mat DrawMenu(Random& random, const std::string& title) {
  cv::Mat image(512, 420, CV_8UC3, cv::Scalar(44, 50, 46));
  AddNoise(image, Noise(random, image.size(), 64, 4, 0.7), 8);
  cv::rectangle(image, {0, 0, 420, 512}, {60, 105, 150}, 22);
  const cv::Scalar chalk = RandomColour(random, 20, 110, 225, 255);
  Write(image, title, {44, 84}, 40, chalk, 330, true);
  cv::line(image, {44, 100}, {376, 100}, chalk, 3, cv::LINE_AA);
  for (int y = 140; y < 480; y += 36) {
    Write(image, RandomPhrase(random, 1 + random.Below(2)), {44, y}, 17, kWhite, 230);
    Write(image, Price(random), {312, y}, 17, chalk, 80);
  }
  return image;
}

cv::Mat DrawNoticeBoard(Random& random) {
  cv::Mat image(480, 720, CV_8UC3, cv::Scalar(90, 140, 190));
  AddNoise(image, Noise(random, image.size(), 8, 3, 0.9), 16);
  for (int i = 0; i < 15; ++i) {
    const cv::Size size(90 + random.Below(60), 80 + random.Below(80));
    const cv::Point at(24 + i % 5 * 138 + random.Below(20), 20 + i / 5 * 152 + random.Below(16));
    const cv::Rect paper = cv::Rect(at, size) & cv::Rect(0, 0, 720, 480);
    cv::rectangle(image, paper, RandomColour(random, 0, 90, 215, 255), cv::FILLED);
    Write(image, RandomWord(random), {paper.x + 6, paper.y + 20}, 13,
          RandomColour(random, 150, 255, 40, 160), paper.width - 12, true);
    if (random.Chance(0.4)) {
      PaintScenery(image, random, {paper.x + 6, paper.y + 26, paper.width - 12, paper.height / 2});
    } else {
      WriteParagraph(image, random,
                     {paper.x + 6, paper.y + 22, paper.width - 12, paper.height - 28}, 6, kInk);
    }
    cv::circle(image, {paper.x + paper.width / 2, paper.y + 5}, 5,
               RandomColour(random, 200, 255, 150, 255), cv::FILLED, cv::LINE_AA);
  }
  cv::rectangle(image, {0, 0, 720, 480}, {60, 80, 100}, 14);
  return image;
}

cv::Mat DrawInfoPanel(Random& random, const std::string& title) {
  cv::Mat image(640, 480, CV_8UC3, kWhite);
  cv::rectangle(image, {0, 0, 480, 96}, RandomColour(random, 150, 255, 70, 170), cv::FILLED);
  Write(image, title, {24, 64}, 36, kWhite, 430, true);
  PaintScenery(image, random, {24, 120, 200, 180});
  WriteParagraph(image, random, {240, 104, 216, 200}, 9, kInk);
  cv::Point last(40, 480);
  cv::rectangle(image, {24, 320, 432, 180}, {200, 200, 200}, 2);
  for (int x = 70; x <= 440; x += 30) {
    const cv::Point next(x, 340 + random.Below(140));
    cv::line(image, last, next, RandomColour(random, 200, 255, 60, 180), 4, cv::LINE_AA);
    cv::circle(image, next, 6, kInk, cv::FILLED, cv::LINE_AA);
    last = next;
  }
  WriteParagraph(image, random, {24, 506, 432, 120}, 9, kInk);
  return image;
}

cv::Mat DrawSign(const std::string& text, cv::Scalar ground, cv::Scalar ink) {
  const int width = std::max(128, 44 * static_cast<int>(text.size()));
  cv::Mat image(96, width, CV_8UC3, ground);
  int baseline = 0;
  const cv::Size size = cv::getTextSize(text, cv::FONT_HERSHEY_DUPLEX, 2, 5, &baseline);
  const int text_width = std::min(size.width, width - 24);
  Write(image, text, {(width - text_width) / 2, 68}, 42, ink, text_width, true);
  cv::rectangle(image, {3, 3, width - 6, 90}, ink, 2);
  return image;
}

cv::Mat DrawDoor(Random& random, Random design, cv::Scalar wood, const std::string& number) {
  cv::Mat image(512, 256, CV_8UC3);
  cv::resize(DrawWood(random, wood, 1), image, image.size());
  const int rail = 24 + design.Below(24), lock = 240 + design.Below(60);
  const int columns = 1 + design.Below(2), bead = 3 + design.Below(4);
  const int panel_width = (256 - rail * (columns + 1)) / columns;
  for (int i = 0; i < columns; ++i) {
    const int x = rail + i * (panel_width + rail);
    for (const cv::Rect& panel : {cv::Rect(x, lock + 40, panel_width, 440 - lock),
                                  cv::Rect(x, 66, panel_width, lock - 90)}) {
      cv::rectangle(image, panel, Shade(wood, 0.55), bead);
      cv::rectangle(image, panel - cv::Size(18, 18) + cv::Point(9, 9), Shade(wood, 1.35), 2);
    }
  }
  if (design.Chance(0.6)) {
    const int height = 80 + design.Below(100), width = 50 + design.Below(60);
    const cv::Rect pane(70 + design.Below(40), 80, width, height);
    VerticalGradient(image, pane, {210, 200, 180}, {150, 140, 120});
    cv::rectangle(image, pane, {50, 60, 70}, 4);
  }
  const int handle = design.Chance(0.5) ? 24 : 226;
  cv::rectangle(image, {handle - 6, lock, 12, 40}, {190, 195, 200}, cv::FILLED);
  cv::line(image, {handle, lock + 16}, {handle < 128 ? handle + 30 : handle - 30, lock + 16},
           {220, 225, 228}, 8, cv::LINE_AA);
  const int plate_top = 20 + design.Below(12);
  const cv::Point plate(40 + design.Below(100), plate_top);
  cv::rectangle(image, {plate, cv::Size(76, 30)}, kWhite, cv::FILLED);
  Write(image, number, plate + cv::Point(8, 23), 18, kInk, 62, true);
  cv::rectangle(image, {0, 0, 256, 512}, Shade(wood, 0.6), 14);
  return image;
}

cv::Mat DrawWindow(Random& random) {
  cv::Mat image(512, 640, CV_8UC3);
  VerticalGradient(image, {0, 0, 640, 512}, {250, 225, 190}, {252, 246, 238});
  for (int x = -20; x < 640;) {
    const int width = 70 + random.Below(90), height = 140 + random.Below(200);
    const cv::Scalar wall = RandomColour(random, 15, 90, 120, 220);
    cv::rectangle(image, {x, 440 - height, width, height}, wall, cv::FILLED);
    for (int wy = 452 - height; wy < 420; wy += 28) {
      for (int wx = x + 8; wx < x + width - 14; wx += 24) {
        cv::rectangle(image, {wx, wy, 13, 17}, Shade(wall, random.Chance(0.3) ? 1.3 : 0.5),
                      cv::FILLED);
      }
    }
    x += width + random.Below(12);
  }
  cv::rectangle(image, {0, 440, 640, 72}, {120, 130, 128}, cv::FILLED);
  for (int i = 0; i < 4; ++i) {
    const cv::Point tree(random.Below(640), 420);
    cv::line(image, tree, {tree.x, 460}, {40, 60, 80}, 9);
    for (int leaf = 0; leaf < 60; ++leaf) {
      cv::circle(image,
                 {tree.x + cvRound(random.Normal(26)), tree.y - 40 + cvRound(random.Normal(30))},
                 4 + random.Below(9), {50 + random.Uniform(0, 50), 110 + random.Uniform(0, 80), 50},
                 cv::FILLED, cv::LINE_AA);
    }
  }
  const cv::Scalar frame = RandomColour(random, 5, 60, 60, 230);
  cv::rectangle(image, {0, 0, 640, 512}, frame, 18 + random.Below(16));
  const int lights = 1 + random.Below(4), bar = 8 + random.Below(10);
  for (int i = 1; i < lights; ++i) {
    cv::line(image, {640 * i / lights, 0}, {640 * i / lights, 512}, frame, bar);
  }
  const int transom = 90 + random.Below(200);
  if (random.Chance(0.7)) cv::line(image, {0, transom}, {640, transom}, frame, bar);
  return image;
}

cv::Mat DrawFloorPlan(Random& random) {
  cv::Mat image(480, 720, CV_8UC3, cv::Scalar(235, 240, 238));
  Write(image, RandomPhrase(random, 2), {30, 56}, 30, {120, 60, 20}, 400, true);
  const int corridor = 200 + random.Below(120);
  int number = 1;
  for (const cv::Rect& side :
       {cv::Rect(30, 80, 0, corridor - 80), cv::Rect(30, corridor + 40, 0, 410 - corridor)}) {
    for (int x = side.x; x < 600;) {
      const int width = std::min(690 - x, 80 + random.Below(140));
      const cv::Rect room(x, side.y, width, side.height - random.Below(40));
      cv::rectangle(image, room, RandomColour(random, 30, 110, 210, 255), cv::FILLED);
      cv::rectangle(image, room, kInk, 4);
      Write(image, std::to_string(number++), {x + 14, room.y + 46}, 28, kInk, 60, true);
      Write(image, RandomWord(random), {x + 14, room.y + 76}, 12, kInk, width - 20);
      x += width;
    }
  }
  cv::circle(image, {60 + random.Below(600), corridor + 20}, 12, {30, 30, 220}, cv::FILLED,
             cv::LINE_AA);
  cv::rectangle(image, {0, 0, 720, 480}, {110, 80, 50}, 12);
  return image;
}

cv::Mat DrawWhiteboard(Random& random) {
  cv::Mat image(400, 800, CV_8UC3, cv::Scalar(240, 242, 240));
  for (int i = 0; i < 9; ++i) {
    const cv::Scalar pen = RandomColour(random, 180, 255, 40, 200);
    const cv::Point at(40 + random.Below(560), 60 + i * 36);
    Write(image, RandomPhrase(random, 2 + random.Below(3)), at, 18, pen, 740 - at.x);
    if (random.Chance(0.5)) {
      cv::ellipse(image, at + cv::Point(60, 30), {70, 30}, 0, 0, 360, pen, 3, cv::LINE_AA);
      cv::arrowedLine(image, at, {random.Below(800), random.Below(400)}, pen, 3, cv::LINE_AA);
    }
  }
  cv::rectangle(image, {0, 0, 800, 400}, {150, 150, 150}, 14);
  return image;
}

cv::Mat DrawExtinguisher(Random& random) {
  const cv::Scalar red{random.Uniform(10, 60), random.Uniform(10, 50), random.Uniform(140, 215)};
  cv::Mat image(256, 96, CV_8UC3, RandomColour(random, 0, 50, 150, 240));
  const int half = 18 + random.Below(16), shoulder = 60 + random.Below(60);
  cv::rectangle(image, {48 - half, shoulder, 2 * half, 246 - shoulder}, red, cv::FILLED);
  cv::ellipse(image, {48, shoulder}, {half, 8 + random.Below(20)}, 0, 180, 360, red, cv::FILLED,
              cv::LINE_AA);
  const int neck = 4 + random.Below(8), tilt = random.Below(30) - 15;
  cv::rectangle(image, {48 - neck, shoulder - 40, 2 * neck, 30}, kInk, cv::FILLED);
  cv::line(image, {26, shoulder - 40 + tilt}, {70, shoulder - 40 - tilt}, kInk,
           5 + random.Below(5));
  const int side = random.Chance(0.5) ? 1 : -1;
  const int hose_width = 12 + random.Below(14), hose_length = 30 + random.Below(50);
  cv::ellipse(image, {48 + side * half / 2, shoulder + 20}, {hose_width, hose_length}, 0,
              -90 * side, 90 * side, kInk, 4 + random.Below(4), cv::LINE_AA);
  const int label_height = 36 + random.Below(50), label_inset = 2 + random.Below(8);
  const cv::Rect label(48 - half + label_inset, shoulder + 30, 2 * (half - label_inset),
                       label_height);
  cv::rectangle(image, label, RandomColour(random, 0, 160, 180, 255), cv::FILLED);
  Write(image, RandomWord(random), {label.x + 2, label.y + 16}, 11, red, label.width - 4, true);
  WriteParagraph(image, random, {label.x + 2, label.y + 16, label.width - 4, label_height - 18}, 4,
                 kInk);
  return image;
}

cv::Mat DrawFossil(Random& random) {
  const cv::Scalar bone(150 + random.Uniform(0, 50), 185 + random.Uniform(0, 40),
                        205 + random.Uniform(0, 40));
  cv::Mat image = Transparent({384, 384}, bone);
  const double turns = random.Uniform(2.2, 4.0), start = random.Uniform(0, 6.28);
  for (int i = 0; i < 260; ++i) {  // an ammonite
    const double part = i / 260.0, angle = start + turns * 6.2832 * part, radius = 20 + 130 * part;
    const cv::Point at(cvRound(192 + radius * std::cos(angle)),
                       cvRound(192 + radius * std::sin(angle)));
    cv::circle(image, at, cvRound(8 + 26 * part),
               Opaque(Shade(bone, i % 13 < 3 ? 0.5 : 0.75 + 0.3 * part)), cv::FILLED, cv::LINE_8);
  }
  return image;
}

cv::Mat DrawPerson(Random& random) {
  const cv::Scalar shirt = RandomColour(random, 60, 230, 50, 230),
                   trousers = RandomColour(random, 20, 140, 30, 130);
  const cv::Scalar skin = Shade({140, 175, 225}, random.Uniform(0.45, 1.05)),
                   hair = RandomColour(random, 30, 140, 20, 110);
  cv::Mat image = Transparent({200, 512}, shirt);
  const int stride = 10 + random.Below(28);
  for (const int side : {-1, 1}) {
    cv::line(image, {100 + side * 16, 290}, {100 + side * stride, 480},
             Opaque(Shade(trousers, side < 0 ? 0.8 : 1)), 34);
    cv::ellipse(image, {100 + side * stride + 6, 496}, {24, 12}, 0, 0, 360, Opaque(hair),
                cv::FILLED);
    const cv::Point hand(100 + side * (52 + random.Below(20)), 270 + random.Below(20));
    cv::line(image, {100 + side * 44, 120}, hand, Opaque(Shade(shirt, 0.85)), 24);
    cv::circle(image, hand, 13, Opaque(skin), cv::FILLED);
  }
  cv::rectangle(image, {54, 104, 92, 190}, Opaque(shirt), cv::FILLED);
  cv::ellipse(image, {100, 110}, {50, 24}, 0, 180, 360, Opaque(shirt), cv::FILLED);
  const int style = random.Below(3);
  for (int y = 118; style == 0 && y < 290; y += 18) {
    cv::line(image, {56, y}, {144, y}, Opaque(Shade(shirt, 0.55)), 6);
  }
  for (int i = 0; style == 1 && i < 24; ++i) {
    cv::circle(image, {62 + random.Below(76), 116 + random.Below(170)}, 6,
               Opaque(Shade(shirt, 1.5)), cv::FILLED);
  }
  if (style == 2)
    Write(image, RandomWord(random), {62, 190}, 20, Opaque(Shade(shirt, 0.4)), 76, true);
  cv::rectangle(image, {88, 76, 24, 26}, Opaque(Shade(skin, 0.85)), cv::FILLED);
  cv::ellipse(image, {100, 44}, {34, 40}, 0, 0, 360, Opaque(hair), cv::FILLED);
  if (random.Chance(0.55)) {
    cv::ellipse(image, {100, 54}, {27, 33}, 0, 0, 360, Opaque(skin), cv::FILLED);
    for (const int x : {90, 110}) cv::circle(image, {x, 50}, 4, Opaque(kInk), cv::FILLED);
    cv::line(image, {92, 72}, {108, 72}, Opaque({80, 80, 150}), 3);
  } else {  // seen from behind, with a bag
    cv::rectangle(image, {66, 128, 68, 96}, Opaque(RandomColour(random, 80, 220, 40, 160)),
                  cv::FILLED);
  }
  return image;
}

cv::Mat DrawPlant(Random& random) {
  cv::Mat image = Transparent({256, 384}, {50, 110, 60});
  for (int i = 0; i < 70; ++i) {
    const double angle = random.Uniform(-1.25, 1.25), length = random.Uniform(60, 230);
    const cv::Point tip(cvRound(128 + length * 0.6 * std::sin(angle)),
                        cvRound(270 - length * std::cos(angle)));
    const cv::Scalar green(30 + random.Uniform(0, 50), 80 + random.Uniform(0, 110),
                           30 + random.Uniform(0, 60), 255);
    cv::line(image, {128, 290}, tip, Opaque(Shade(green, 0.6)), 3);
    cv::ellipse(image, tip, {8 + random.Below(10), 20 + random.Below(18)}, angle * 57.3, 0, 360,
                green, cv::FILLED);
  }
  const std::vector<cv::Point> pot{{78, 280}, {178, 280}, {162, 382}, {94, 382}};
  cv::fillConvexPoly(image, pot, Opaque(RandomColour(random, 60, 180, 70, 200)));
  cv::rectangle(image, {72, 274, 112, 20}, Opaque(RandomColour(random, 60, 180, 90, 200)),
                cv::FILLED);
  return image;
}

cv::Mat DrawMannequin(Random& random) {
  const cv::Scalar dress = RandomColour(random, 70, 240, 60, 230), body(190, 205, 215);
  cv::Mat image = Transparent({192, 544}, dress);
  cv::rectangle(image, {92, 400, 8, 130}, Opaque({60, 60, 60}), cv::FILLED);
  cv::ellipse(image, {96, 532}, {50, 10}, 0, 0, 360, Opaque({60, 60, 60}), cv::FILLED);
  cv::ellipse(image, {96, 46}, {28, 40}, 0, 0, 360, Opaque(body), cv::FILLED);
  cv::rectangle(image, {86, 80, 20, 30}, Opaque(Shade(body, 0.85)), cv::FILLED);
  for (const int side : {-1, 1})
    cv::line(image, {96 + side * 42, 122}, {96 + side * 54, 260}, Opaque(body), 18);
  const int flare = 46 + random.Below(44), hem = 330 + random.Below(120);
  const std::vector<cv::Point> gown{{50, 106},         {142, 106},        {130, 210},
                                    {96 + flare, hem}, {96 - flare, hem}, {62, 210}};
  cv::fillPoly(image, std::vector{gown}, Opaque(dress));
  cv::Mat pattern = image.clone();
  for (int i = 0; i < 90; ++i) {
    cv::circle(pattern, {random.Below(192), 100 + random.Below(360)}, 3 + random.Below(8),
               Opaque(RandomColour(random, 60, 255, 80, 255)), random.Chance(0.5) ? 2 : cv::FILLED);
  }
  cv::Mat gown_mask = cv::Mat::zeros(image.size(), CV_8U);
  cv::fillPoly(gown_mask, std::vector{gown}, 255);
  pattern.copyTo(image, gown_mask);
  cv::line(image, {62, 212}, {130, 212}, Opaque(RandomColour(random, 100, 255, 20, 120)), 10);
  if (random.Chance(0.6))
    cv::ellipse(image, {96, 22}, {52, 12}, 0, 0, 360, Opaque(Shade(dress, 0.6)), cv::FILLED);
  return image;
}

}  // namespace viewfix::simulation
