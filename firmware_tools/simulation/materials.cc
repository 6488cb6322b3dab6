// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "firmware_tools/simulation/artwork.h"
#include "firmware_tools/simulation/draw.h"

namespace viewfix::simulation {

cv::Mat DrawPlainColour(cv::Scalar colour) { return cv::Mat(4, 4, CV_8UC3, colour); }

cv::Mat DrawPlaster(Random& random, cv::Scalar colour) {
  cv::Mat image(512, 512, CV_8UC3, colour);
  AddNoise(image, Noise(random, image.size(), 128, 7, 0.75), 6);
  return image;
}

cv::Mat DrawBricks(Random& random, cv::Scalar colour) {
  constexpr int kColumns = 8, kRows = 16, kWidth = 128, kHeight = 32;
  cv::Mat image(kRows * kHeight, kColumns * kWidth, CV_8UC3, cv::Scalar(168, 176, 182));
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      const cv::Scalar brick = Shade(colour, random.Uniform(0.72, 1.2));
      const int x = column * kWidth + (row % 2) * kWidth / 2;
      const cv::Rect area(x + 3, row * kHeight + 3, kWidth - 6, kHeight - 6);
      cv::rectangle(image, area, brick, cv::FILLED);
      cv::rectangle(image, area - cv::Point(image.cols, 0), brick, cv::FILLED);
    }
  }
  AddNoise(image, Noise(random, image.size(), 64, 6, 0.8), 12);
  return image;
}

cv::Mat DrawWood(Random& random, cv::Scalar colour, int planks) {
  cv::Mat image(512, 512, CV_8UC3);
  const int width = image.cols / planks;
  for (int i = 0; i < planks; ++i) {
    image.colRange(i * width, i + 1 == planks ? image.cols : (i + 1) * width) =
        Shade(colour, random.Uniform(0.85, 1.12));
  }
  AddNoise(image, Noise(random, image.size(), 24, 4, 0.8, 12), 11);
  for (int i = 0; planks > 1 && i < planks; ++i) {
    cv::line(image, {i * width, 0}, {i * width, image.rows}, Shade(colour, 0.45), 2);
    const int y = random.Below(image.rows);
    cv::line(image, {i * width, y}, {(i + 1) * width, y}, Shade(colour, 0.5), 2);
  }
  for (int i = random.Below(4) + planks / 2; i > 0; --i) {
    const cv::Point knot(random.Below(image.cols), random.Below(image.rows));
    cv::ellipse(image, knot, {4 + random.Below(5), 8 + random.Below(10)}, 0, 0, 360,
                Shade(colour, 0.6), 2, cv::LINE_AA);
  }
  return image;
}

cv::Mat DrawFloorTiles(Random& random, cv::Scalar light, cv::Scalar dark) {
  constexpr int kTile = 128;
  cv::Mat image(4 * kTile, 4 * kTile, CV_8UC3, cv::Scalar(120, 120, 120));
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      const cv::Scalar tile = (row + column) % 2 ? dark : light;
      cv::rectangle(image, {column * kTile + 2, row * kTile + 2, kTile - 3, kTile - 3},
                    Shade(tile, random.Uniform(0.92, 1.06)), cv::FILLED);
    }
  }
  AddNoise(image, Noise(random, image.size(), 64, 5, 0.7), 8);
  return image;
}

cv::Mat DrawMarble(Random& random, cv::Scalar colour) {
  cv::Mat image(512, 512, CV_8UC3, colour);
  const cv::Mat noise = Noise(random, image.size(), 128, 6, 0.6);
  // Veins run where the noise crosses zero.
  cv::Mat veins = 1.0 / (0.08 + cv::abs(noise));
  AddNoise(image, noise, 9);
  AddNoise(image, -veins, 4);
  return image;
}

cv::Mat DrawWallpaper(Random& random, cv::Scalar colour) {
  constexpr int kCell = 128;
  cv::Mat image(4 * kCell, 4 * kCell, CV_8UC3, colour);
  const cv::Scalar ink = Shade(colour, 1.35), dark = Shade(colour, 0.7);
  const int petals = 3 + random.Below(6);
  const int length = kCell / 5 + random.Below(kCell / 4), breadth = 3 + random.Below(kCell / 6);
  const int heart = 4 + random.Below(kCell / 8);
  const double turn = random.Uniform(0, 90);
  for (int i = 0; i < 16 + 4; ++i) {
    const cv::Point at(i % 4 * kCell + kCell / 2, i / 4 * kCell + kCell / 2 - (i % 2) * kCell / 2);
    for (int p = 0; p < petals; ++p) {
      cv::ellipse(image, at, {length, breadth}, 180.0 * p / petals + turn, 0, 360, ink, 2,
                  cv::LINE_AA);
    }
    cv::circle(image, at, heart, dark, cv::FILLED, cv::LINE_AA);
    cv::circle(image, at, heart / 2, ink, cv::FILLED, cv::LINE_AA);
  }
  AddNoise(image, Noise(random, image.size(), 32, 4, 0.7), 5);
  return image;
}

cv::Mat DrawCeiling(Random& random) {
  cv::Mat image(256, 256, CV_8UC3, cv::Scalar(224, 228, 230));
  for (int i = 0; i < 900; ++i) {
    cv::circle(image, {random.Below(256), random.Below(256)}, random.Below(2), {190, 195, 198},
               cv::FILLED);
  }
  const int columns = 1 + random.Below(3), rows = 1 + random.Below(3), width = 2 + random.Below(4);
  for (int i = 0; i < columns; ++i) {
    cv::line(image, {i * 256 / columns, 0}, {i * 256 / columns, 256}, {165, 168, 170}, width);
  }
  for (int i = 0; i < rows; ++i) {
    cv::line(image, {0, i * 256 / rows}, {256, i * 256 / rows}, {165, 168, 170}, width);
  }
  return image;
}

cv::Mat DrawCarpet(Random& random, cv::Scalar colour) {
  cv::Mat image(512, 512, CV_8UC3, colour);
  for (int i = 0; i < 64; ++i) {
    const cv::Rect tuft(random.Below(480), random.Below(480), 6 + random.Below(26),
                        6 + random.Below(26));
    cv::rectangle(image, tuft, Shade(colour, random.Uniform(0.75, 1.25)), cv::FILLED);
  }
  AddNoise(image, Noise(random, image.size(), 16, 4, 0.9), 9);
  return image;
}

cv::Mat DrawRug(Random& random) {
  cv::Mat image(384, 512, CV_8UC3, RandomColour(random, 130, 220, 60, 140));
  for (int inset = 8; inset < 150; inset += 12 + random.Below(20)) {
    cv::rectangle(image, {inset, inset, 512 - 2 * inset, 384 - 2 * inset},
                  RandomColour(random, 60, 220, 60, 230), 4 + random.Below(10));
  }
  for (int i = 0; i < 9; ++i) {
    const cv::Point at(80 + i * 44, 192);
    const std::vector<cv::Point> diamond{at + cv::Point(0, -36), at + cv::Point(20, 0),
                                         at + cv::Point(0, 36), at + cv::Point(-20, 0)};
    cv::fillConvexPoly(image, diamond, RandomColour(random, 80, 220, 90, 240), cv::LINE_AA);
  }
  AddNoise(image, Noise(random, image.size(), 8, 3, 0.9), 9);
  return image;
}

cv::Mat DrawLamp(Random& random) {
  cv::Mat image(64, 256, CV_8UC3, cv::Scalar(150, 150, 150));
  cv::rectangle(image, {6, 6, 244, 52}, {250, 255, 255}, cv::FILLED);
  const int step = 12 + random.Below(50);
  for (int x = 6 + step; x < 250; x += step) cv::line(image, {x, 6}, {x, 58}, {205, 212, 214}, 3);
  const int tubes = random.Below(3);
  for (int i = 1; i <= tubes; ++i) {
    const int y = 6 + 52 * i / (tubes + 1);
    cv::line(image, {6, y}, {250, y}, {205, 212, 214}, 3);
  }
  return image;
}

cv::Mat DrawDisc(cv::Scalar colour) {
  cv::Mat image = cv::Mat::zeros(128, 128, CV_8UC4);
  image = cv::Scalar(colour[0], colour[1], colour[2], 0);
  cv::circle(image, {64, 64}, 62, {colour[0], colour[1], colour[2], 255}, cv::FILLED);
  return image;
}

}  // namespace viewfix::simulation
