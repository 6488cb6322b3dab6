// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/floor_plan.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/dataset/tool_file.h"
#include "firmware_tools/mapping/georeference.h"
#include "models/model_view.h"

namespace viewfix {
namespace {

namespace fs = std::filesystem;

constexpr double kMaxRms = 0.5;       // metres
constexpr double kLeastScale = 1e-6;  // metres a pixel
constexpr double kShrink = 0.8;       // of each side, until the file is small enough
constexpr int kMaxSide = 65535;

struct PlanPoint {
  Eigen::Vector2d pixel;
  Eigen::Vector2d point_in_site;
};

std::vector<PlanPoint> ReadPoints(const fs::path& file) {
  const Result<CsvTable> table = ParseCsv(ReadTextFile(file));
  if (!table.ok()) throw ToolError(file.string() + ": " + Describe(table.status()));
  constexpr const char* kNames[] = {"px", "py", "x", "y"};
  std::array<int, 4> columns;
  for (int i = 0; i < 4; ++i) {
    columns[i] = table->Column(kNames[i]);
    if (columns[i] < 0) throw ToolError(file.string() + ": no column called " + kNames[i]);
  }
  std::vector<PlanPoint> points;
  for (const CsvTable::Row& row : table->rows) {
    std::array<double, 4> values;
    for (int i = 0; i < 4; ++i) values[i] = CoordinateOf(row, columns[i], file);
    points.push_back({{values[0], values[1]}, {values[2], values[3]}});
  }
  return points;
}

// Least squares for a, b, tx and ty.
void Align(const std::vector<PlanPoint>& points, const fs::path& file, FloorPlan& plan) {
  const auto n = static_cast<Eigen::Index>(points.size());
  Eigen::MatrixXd system(2 * n, 4);
  Eigen::VectorXd site(2 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Vector2d& p = points[i].pixel;
    system.row(2 * i) << p.x(), p.y(), 1, 0;
    system.row(2 * i + 1) << -p.y(), p.x(), 0, 1;
    site.segment<2>(2 * i) = points[i].point_in_site;
  }
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> solver(system);
  if (n < 2 || solver.rank() < 4) {
    throw ToolError(file.string() + ": two different points of the plan are needed");
  }
  const Eigen::Vector4d solved = solver.solve(site);
  if (!(solved.head<2>().norm() > kLeastScale)) {
    throw ToolError(file.string() + ": the points are one place on the site");
  }
  std::copy_n(solved.data(), 4, plan.site_from_pixel.begin());
  plan.rms_metres = (system * solved - site).norm() / std::sqrt(static_cast<double>(n));
  if (plan.rms_metres <= kMaxRms) return;
  char text[96];
  std::snprintf(text, sizeof text, ": the points do not fit the plan: %.2f m off", plan.rms_metres);
  throw ToolError(file.string() + text);
}

cv::Mat Decode(const fs::path& file, const std::string& bytes) {
  cv::Mat picture;
  try {
    if (IsFloorPlanPicture({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()})) {
      picture = cv::imdecode(
          cv::Mat(1, static_cast<int>(bytes.size()), CV_8U, const_cast<char*>(bytes.data())),
          cv::IMREAD_COLOR);
    }
  } catch (const cv::Exception&) {  // sizes beyond OpenCV's limits
  }
  if (picture.empty()) throw ToolError(file.string() + ": not a PNG or JPEG, or a damaged one");
  return picture;
}

// The file's bytes; or those of a smaller picture, as `picture` then is.
std::vector<std::uint8_t> SmallEnough(const std::string& bytes, cv::Mat& picture) {
  std::vector<std::uint8_t> file(bytes.begin(), bytes.end());
  const char* format = file[0] == 0xFF ? ".jpg" : ".png";
  while (file.size() > kMaxFloorPlanBytes || std::max(picture.cols, picture.rows) > kMaxSide) {
    cv::Mat smaller;
    cv::resize(picture, smaller, {}, kShrink, kShrink, cv::INTER_AREA);
    picture = smaller;
    cv::imencode(format, picture, file);
  }
  return file;
}

}  // namespace

FloorPlan ReadFloorPlan(const fs::path& picture_file, const fs::path& align_file) {
  const std::string bytes = ReadTextFile(picture_file);
  cv::Mat picture = Decode(picture_file, bytes);
  const cv::Size original = picture.size();
  FloorPlan plan;
  plan.picture = SmallEnough(bytes, picture);
  plan.width = picture.cols;
  plan.height = picture.rows;
  std::vector<PlanPoint> points = ReadPoints(align_file);
  const Eigen::Array2d shrink(static_cast<double>(plan.width) / original.width,
                              static_cast<double>(plan.height) / original.height);
  for (PlanPoint& point : points) {
    point.pixel = ((point.pixel.array() + 0.5) * shrink - 0.5).matrix();
  }
  Align(points, align_file, plan);
  return plan;
}

}  // namespace viewfix
