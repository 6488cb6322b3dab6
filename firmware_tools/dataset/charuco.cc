// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/dataset/charuco.h"

#include <cstdio>
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/dataset/tool_file.h"

namespace viewfix {
namespace {

constexpr float kMarkerShare = 0.7F;
// In units of 1/20 of a square, every edge of a marker's modules is whole.
constexpr int kUnitsASquare = 20;
constexpr int kMarginUnits = 20;
constexpr int kPixelsAUnit = 15;
constexpr int kMaxSquares = 200;  // the dictionary has 100 markers

cv::Ptr<cv::aruco::CharucoBoard> MakeBoard(const CharucoSpec& spec) {
  const auto square = static_cast<float>(spec.square_mm / 1000);
  return cv::aruco::CharucoBoard::create(
      spec.squares_x, spec.squares_y, square, kMarkerShare * square,
      cv::aruco::getPredefinedDictionary(cv::aruco::DICT_5X5_100));
}

// The board without margin, a pixel a unit.
cv::Mat DrawUnits(const CharucoSpec& spec) {
  cv::Mat units;
  MakeBoard(spec)->draw({spec.squares_x * kUnitsASquare, spec.squares_y * kUnitsASquare}, units);
  return units;
}

std::string Caption(const CharucoSpec& spec) {
  char text[160];
  std::snprintf(text, sizeof text, "ChArUco %d x %d, square %g mm, marker %g mm, 5x5_100",
                spec.squares_x, spec.squares_y, spec.square_mm, kMarkerShare * spec.square_mm);
  return text;
}

std::string PngBytes(const CharucoSpec& spec) {
  cv::Mat board, page;
  cv::resize(DrawUnits(spec), board, {}, kPixelsAUnit, kPixelsAUnit, cv::INTER_NEAREST);
  constexpr int kMargin = kMarginUnits * kPixelsAUnit;
  cv::copyMakeBorder(board, page, kMargin, kMargin, kMargin, kMargin, cv::BORDER_CONSTANT, 255);
  cv::putText(page, Caption(spec), {kMargin, page.rows - kMargin / 3}, cv::FONT_HERSHEY_SIMPLEX, 2,
              0, 3, cv::LINE_AA);
  std::vector<std::uint8_t> bytes;
  cv::imencode(".png", page, bytes);
  return {bytes.begin(), bytes.end()};
}

// Black runs of a row; runs that the row above has too were drawn with it.
void AppendRuns(const cv::Mat& units, int y, std::string& svg) {
  const auto is_black = [&](int row, int x) {
    return row >= 0 && row < units.rows && x >= 0 && x < units.cols &&
           units.at<std::uint8_t>(row, x) < 128;
  };
  const auto is_run = [&](int row, int begin, int end) {
    if (is_black(row, begin - 1) || is_black(row, end)) return false;
    for (int x = begin; x < end; ++x) {
      if (!is_black(row, x)) return false;
    }
    return true;
  };
  for (int x = 0; x < units.cols; ++x) {
    if (!is_black(y, x) || is_black(y, x - 1)) continue;
    int end = x;
    while (is_black(y, end)) ++end;
    if (is_run(y - 1, x, end)) continue;
    int bottom = y + 1;
    while (is_run(bottom, x, end)) ++bottom;
    char rect[96];
    std::snprintf(rect, sizeof rect, "<rect x=\"%d\" y=\"%d\" width=\"%d\" height=\"%d\"/>\n", x, y,
                  end - x, bottom - y);
    svg += rect;
  }
}

std::string SvgText(const CharucoSpec& spec) {
  const cv::Mat units = DrawUnits(spec);
  const double mm = spec.square_mm / kUnitsASquare;
  const int width = units.cols + 2 * kMarginUnits, height = units.rows + 2 * kMarginUnits;
  char head[256];
  std::snprintf(head, sizeof head,
                "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%gmm\" height=\"%gmm\" "
                "viewBox=\"%d %d %d %d\" shape-rendering=\"crispEdges\">\n",
                width * mm, height * mm, -kMarginUnits, -kMarginUnits, width, height);
  std::string svg = head;
  for (int y = 0; y < units.rows; ++y) AppendRuns(units, y, svg);
  std::snprintf(head, sizeof head, "<text x=\"0\" y=\"%d\" font-size=\"5\">", units.rows + 12);
  return svg.append(head).append(Caption(spec)).append("</text>\n</svg>\n");
}

}  // namespace

void CheckSpec(const CharucoSpec& spec) {
  const bool fits = spec.squares_x >= 3 && spec.squares_y >= 3 && spec.squares_x <= 20 &&
                    spec.squares_y <= 20 && spec.squares_x * spec.squares_y <= kMaxSquares;
  if (!fits) throw ToolError("a board has 3 to 20 squares a side, and at most 200");
  if (!(spec.square_mm >= 1 && spec.square_mm <= 1000)) {
    throw ToolError("a board's squares are 1 to 1000 mm wide");
  }
}

BoardView FindBoard(const YuvImage& image, const CharucoSpec& spec, const std::string& name) {
  BoardView view{name, {}, {}};
  const cv::Mat pixels(image.height, image.width, CV_8U,
                       const_cast<std::uint8_t*>(image.pixels.data()));
  const cv::Ptr<cv::aruco::CharucoBoard> board = MakeBoard(spec);
  std::vector<std::vector<cv::Point2f>> marker_corners;
  std::vector<int> marker_ids;
  cv::aruco::detectMarkers(pixels, board->dictionary, marker_corners, marker_ids);
  if (marker_ids.empty()) return view;
  std::vector<cv::Point2f> corners;
  cv::aruco::interpolateCornersCharuco(marker_corners, marker_ids, pixels, board, corners,
                                       view.corner_ids);
  for (const cv::Point2f& corner : corners) view.pixels.emplace_back(corner.x, corner.y);
  return view;
}

std::vector<Eigen::Vector3d> BoardCorners(const CharucoSpec& spec) {
  std::vector<Eigen::Vector3d> corners;
  const cv::Ptr<cv::aruco::CharucoBoard> board = MakeBoard(spec);
  for (const cv::Point3f& corner : board->chessboardCorners) {
    corners.emplace_back(corner.x, corner.y, corner.z);
  }
  return corners;
}

void PrintBoard(const CharucoSpec& spec, const std::filesystem::path& file) {
  CheckSpec(spec);
  if (file.extension() == ".svg") {
    WriteTextFile(file, SvgText(spec));
  } else if (file.extension() == ".png") {
    WriteTextFile(file, PngBytes(spec));
  } else {
    throw ToolError(file.string() + ": a board is written as .svg or .png");
  }
}

}  // namespace viewfix
