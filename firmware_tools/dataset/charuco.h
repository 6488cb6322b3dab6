// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "platform/camera/jpeg_decoder.h"

namespace viewfix {

// A chessboard with a 5x5_100 ArUco marker, 0.7 of the side, in every white square. The defaults
// fit A4 and US letter paper. Only flatness matters to a calibration, not the size in print.
struct CharucoSpec {
  int squares_x = 10;  // 3 to 20
  int squares_y = 7;   // 3 to 20, at most 200 squares
  double square_mm = 25;

  int corner_count() const { return (squares_x - 1) * (squares_y - 1); }
};

// Throws ToolError: a number out of range.
void CheckSpec(const CharucoSpec& spec);

// The inner corners of the board that an image shows.
struct BoardView {
  std::string name;  // of the image, for people
  std::vector<int> corner_ids;
  std::vector<Eigen::Vector2d> pixels;  // [corner_ids] centres at integers
};

BoardView FindBoard(const YuvImage& image, const CharucoSpec& spec, const std::string& name);

// Place of a corner on the board, metres, z = 0.
std::vector<Eigen::Vector3d> BoardCorners(const CharucoSpec& spec);

// The board for printing, with a line of text that tells its sizes: .svg (in millimetres) or .png
// (15 pixels for 1/20 of a square). Atomic. Throws ToolError: another ending, not writable.
void PrintBoard(const CharucoSpec& spec, const std::filesystem::path& file);

}  // namespace viewfix
