// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "firmware_tools/simulation/random.h"

// Pictures that the museum's surfaces are covered with, drawn at random. Each
// returns 8-bit BGR, those cut out of their background BGRA.
namespace viewfix::simulation {

// Materials. They repeat without a seam.
cv::Mat DrawPlaster(Random& random, cv::Scalar colour);
cv::Mat DrawBricks(Random& random, cv::Scalar colour);                      // 2.0 x 1.2 m
cv::Mat DrawWood(Random& random, cv::Scalar colour, int planks);            // grain runs down
cv::Mat DrawFloorTiles(Random& random, cv::Scalar light, cv::Scalar dark);  // 4 x 4 tiles
cv::Mat DrawMarble(Random& random, cv::Scalar colour);
cv::Mat DrawWallpaper(Random& random, cv::Scalar colour);
cv::Mat DrawCeiling(Random& random);  // panels
cv::Mat DrawCarpet(Random& random, cv::Scalar colour);

// Things that hang or stand.
cv::Mat DrawPoster(Random& random);
cv::Mat DrawPainting(Random& random);  // with its frame
cv::Mat DrawBooks(Random& random);     // one shelf board's worth, 1.2 x 0.32 m
cv::Mat DrawBottles(Random& random);   // one shelf board's worth, 1.2 x 0.4 m
cv::Mat DrawScreen(Random& random);
cv::Mat DrawMenu(Random& random, const std::string& title);
cv::Mat DrawNoticeBoard(Random& random);
cv::Mat DrawInfoPanel(Random& random, const std::string& title);
cv::Mat DrawSign(const std::string& text, cv::Scalar ground, cv::Scalar ink);
// Doors of one `design` differ in their grain and number alone.
cv::Mat DrawDoor(Random& random, Random design, cv::Scalar wood, const std::string& number);
cv::Mat DrawWindow(Random& random);  // daylight and a street
cv::Mat DrawFloorPlan(Random& random);
cv::Mat DrawWhiteboard(Random& random);
cv::Mat DrawLamp(Random& random);
cv::Mat DrawExtinguisher(Random& random);
cv::Mat DrawRug(Random& random);
cv::Mat DrawFossil(Random& random);     // BGRA
cv::Mat DrawPerson(Random& random);     // BGRA, 0.7 x 1.8 m
cv::Mat DrawPlant(Random& random);      // BGRA, 0.9 x 1.3 m
cv::Mat DrawMannequin(Random& random);  // BGRA, 0.6 x 1.7 m
cv::Mat DrawDisc(cv::Scalar colour);    // BGRA
cv::Mat DrawPlainColour(cv::Scalar colour);

}  // namespace viewfix::simulation
