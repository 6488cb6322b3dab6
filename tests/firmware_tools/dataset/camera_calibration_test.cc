// SPDX-License-Identifier: BSD-3-Clause
// From a printed board through a known camera back to its calibration.
#include "firmware_tools/dataset/camera_calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "firmware_tools/dataset/calibration_file.h"
#include "firmware_tools/dataset/tool_file.h"
#include "tests/firmware_tools/plane_renderer.h"
#include "tests/testing/temp_folder.h"

namespace viewfix {
namespace {

using ::testing::HasSubstr;

const CharucoSpec kSpec;
const Camera kBrown = {CameraModel::kBrownConrady, 640, 480, 520, 519, 318.7, 241.2,
                       {-0.11, 0.035, 1e-3, -5e-4}};
const Camera kFisheye = {CameraModel::kKannalaBrandt, 640, 480, 290, 291, 322.4, 237.9,
                         {0.03, -0.01, 2e-3, -5e-4}};
// The printed board, shrunk to 2.5 pixels a module: 10 x 7 squares and a margin of one.
constexpr double kBoardWidth = 0.3, kBoardHeight = 0.225;

cv::Mat PrintedBoard(const TempFolder& folder) {
  PrintBoard(kSpec, folder / "board.png");
  const cv::Mat page = cv::imread(folder / "board.png", cv::IMREAD_GRAYSCALE);
  cv::Mat shrunk;
  cv::resize(page, shrunk, {}, 1.0 / 3, 1.0 / 3, cv::INTER_AREA);
  return shrunk;
}

// Its middle stands `distance` in front of the camera and (x, y) aside, as shares of the
// distance; tilted about x and y, turned about z (degrees).
Rigid3 CamFromBoard(double distance, double x, double y, double tilt_x, double tilt_y,
                    double roll) {
  constexpr double kDegree = 3.14159265358979 / 180;
  const Eigen::Quaterniond rotation =
      Eigen::AngleAxisd(roll * kDegree, Eigen::Vector3d::UnitZ()) *
      Eigen::AngleAxisd(tilt_y * kDegree, Eigen::Vector3d::UnitY()) *
      Eigen::AngleAxisd(tilt_x * kDegree, Eigen::Vector3d::UnitX());
  const Eigen::Vector3d middle(kBoardWidth / 2, kBoardHeight / 2, 0);
  const Eigen::Vector3d in_cam = distance * Eigen::Vector3d(x, y, 1);
  return {rotation, in_cam - rotation * middle};
}

std::vector<Rigid3> DozenPoses(double d) {
  return {CamFromBoard(d, 0, 0, 0, 0, 0),
          CamFromBoard(d, 0.1, 0.05, 30, 0, 5),
          CamFromBoard(d, -0.1, 0, -30, 10, 0),
          CamFromBoard(d, 0, 0.1, 5, 35, 10),
          CamFromBoard(d, 0, -0.1, -5, -35, -10),
          CamFromBoard(1.3 * d, 0.3, 0.2, 20, 20, 0),
          CamFromBoard(1.3 * d, -0.3, 0.2, 20, -20, 8),
          CamFromBoard(1.3 * d, 0.3, -0.2, -20, 20, 0),
          CamFromBoard(1.3 * d, -0.3, -0.2, -20, -20, 4),
          CamFromBoard(d, 0.05, 0.05, 25, 25, 45),
          CamFromBoard(1.1 * d, 0.2, 0, 0, -40, 0),
          CamFromBoard(1.1 * d, -0.2, 0, 0, 40, 0)};
}

std::vector<cv::Mat> Photographs(const Camera& camera, const std::vector<Rigid3>& poses,
                                 const cv::Mat& page) {
  const PlaneRenderer renderer(camera, 2);
  std::vector<cv::Mat> images;
  for (const Rigid3& pose : poses) {
    images.push_back(renderer.Render(pose, page, kBoardWidth / page.cols));
  }
  return images;
}

void WriteAll(const std::vector<cv::Mat>& images, const TempFolder& folder) {
  folder.Write("photos/note.txt", "");
  for (std::size_t i = 0; i < images.size(); ++i) {
    cv::imwrite(folder / ("photos/" + std::string(1, static_cast<char>('a' + i)) + ".png"),
                images[i]);
  }
}

void ExpectNear(const Camera& found, const Camera& truth) {
  EXPECT_NEAR(found.fx / truth.fx, 1, 0.005);
  EXPECT_NEAR(found.fy / truth.fy, 1, 0.005);
  EXPECT_NEAR(found.cx, truth.cx, 2);
  EXPECT_NEAR(found.cy, truth.cy, 2);
}

TEST(Calibrate, RecoversTheCameraAndDropsABentBoard) {
  const TempFolder folder;
  const cv::Mat page = PrintedBoard(folder);
  std::vector<cv::Mat> images = Photographs(kBrown, DozenPoses(0.35), page);
  cv::Mat bent;
  cv::warpAffine(images[0], bent, cv::Matx23d(1, 0.1, 0, 0.05, 1, 0), images[0].size());
  cv::rotate(bent, bent, cv::ROTATE_180);
  for (int y = 0; y < bent.rows; ++y) {  // rows sheared along a curve: no plane looks so
    const cv::Mat row = bent.row(y).clone();
    const int shift = (y - 240) * (y - 240) / 2000;
    if (shift > 0) row.colRange(0, 640 - shift).copyTo(bent.row(y).colRange(shift, 640));
  }
  images.push_back(bent);
  WriteAll(images, folder);
  const BoardViews boards = FindBoards(folder / "photos", kSpec, {});
  const CameraCalibration result = CalibrateCamera(boards, kSpec, CameraModel::kBrownConrady);
  ExpectNear(ToCamera(result.calibration), kBrown);
  EXPECT_NEAR(result.calibration.distortion[0], -0.11, 0.02);
  EXPECT_LT(result.rms_px, 0.3);
  EXPECT_EQ(result.views.size(), 13U);
  EXPECT_FALSE(result.views[12].is_used);
  EXPECT_TRUE(result.views[0].is_used);
}

TEST(Calibrate, RecoversAFisheye) {
  const TempFolder folder;
  WriteAll(Photographs(kFisheye, DozenPoses(0.15), PrintedBoard(folder)), folder);
  const BoardViews boards = FindBoards(folder / "photos", kSpec, {});
  const CameraCalibration result = CalibrateCamera(boards, kSpec, CameraModel::kKannalaBrandt);
  ExpectNear(ToCamera(result.calibration), kFisheye);
  EXPECT_EQ(result.calibration.model, CameraModel::kKannalaBrandt);
  SaveCalibration(result.calibration, folder / "c.yaml");
  EXPECT_EQ(ToCamera(LoadCalibration(folder / "c.yaml")), ToCamera(result.calibration));
}

TEST(Calibrate, ReadsVideos) {
  const TempFolder folder;
  const auto images = Photographs(kBrown, DozenPoses(0.35), PrintedBoard(folder));
  cv::VideoWriter video(folder / "walk.avi", cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 10,
                        {640, 480}, false);
  if (!video.isOpened()) GTEST_SKIP() << "this OpenCV writes no videos";
  for (const cv::Mat& image : images) {
    for (int i = 0; i < 3; ++i) video.write(image);
  }
  video.release();
  const BoardViews boards = FindBoards(folder / "walk.avi", kSpec, {});
  EXPECT_EQ(boards.images, 36);
  EXPECT_EQ(boards.views.size(), 12U) << "frames in which the board has not moved are left out";
  ExpectNear(ToCamera(CalibrateCamera(boards, kSpec, CameraModel::kBrownConrady).calibration),
             kBrown);
}

// What the camera sees of the corners, without rendering.
BoardViews Perfect(const Camera& camera, const std::vector<Rigid3>& poses) {
  BoardViews boards{camera.width, camera.height, {}, static_cast<int>(poses.size())};
  const auto corners = BoardCorners(kSpec);
  for (const Rigid3& pose : poses) {
    BoardView& view = boards.views.emplace_back();
    for (std::size_t id = 0; id < corners.size(); ++id) {
      Eigen::Vector2d pixel;
      const Eigen::Vector3d margin(0.025, 0.025, 0);
      if (!camera.Project(pose * (corners[id] + margin), pixel)) continue;
      view.corner_ids.push_back(static_cast<int>(id));
      view.pixels.push_back(pixel);
    }
  }
  return boards;
}

std::string ErrorOf(const BoardViews& boards) {
  try {
    CalibrateCamera(boards, kSpec, CameraModel::kBrownConrady);
  } catch (const ToolError& error) {
    return error.what();
  }
  return "no error";
}

TEST(Calibrate, RefusesThinMaterial) {
  auto poses = DozenPoses(0.35);
  EXPECT_EQ(ErrorOf(Perfect(kBrown, poses)), "no error");
  poses.resize(5);
  EXPECT_THAT(ErrorOf(Perfect(kBrown, poses)), HasSubstr("usable in 5 of 5 images, and 6"));
  EXPECT_THAT(ErrorOf({640, 480, {}, 0}), HasSubstr("usable in 0"));
  std::vector<Rigid3> far, alike;
  for (const Rigid3& pose : DozenPoses(1)) far.push_back({pose.rotation, {-0.1, -0.1, 3}});
  EXPECT_THAT(ErrorOf(Perfect(kBrown, far)), HasSubstr("covers"));
  for (int i = 0; i < 8; ++i) alike.push_back(CamFromBoard(0.3 + 0.02 * i, 0, 0, i, 0, 0));
  EXPECT_NE(ErrorOf(Perfect(kBrown, alike)), "no error");
}

TEST(Board, PrintsAsPngAndSvg) {
  const TempFolder folder;
  const cv::Mat page = PrintedBoard(folder);
  const cv::Mat rows = page.clone();
  const YuvImage image{rows.cols, rows.rows, {rows.data, rows.data + rows.total()}};
  EXPECT_EQ(FindBoard(image, kSpec, "").corner_ids.size(), 54U);
  PrintBoard(kSpec, folder / "board.svg");
  const std::string svg = ReadTextFile(folder / "board.svg");
  EXPECT_THAT(svg, HasSubstr("width=\"300mm\" height=\"225mm\""));
  EXPECT_THAT(svg, HasSubstr("square 25 mm"));
  cv::Mat drawn(180, 240, CV_8U, cv::Scalar(255));  // the rectangles, 1 pixel a unit
  int x = 0, y = 0, width = 0, height = 0;
  for (std::size_t at = 0; (at = svg.find("<rect", at)) != std::string::npos; ++at) {
    ASSERT_EQ(std::sscanf(svg.c_str() + at, "<rect x=\"%d\" y=\"%d\" width=\"%d\" height=\"%d\"",
                          &x, &y, &width, &height),
              4);
    drawn(cv::Rect(x + 20, y + 20, width, height)) = 0;
  }
  cv::Mat large;
  cv::resize(drawn, large, {}, 5, 5, cv::INTER_NEAREST);
  const YuvImage svg_image{large.cols, large.rows, {large.data, large.data + large.total()}};
  EXPECT_EQ(FindBoard(svg_image, kSpec, "").corner_ids.size(), 54U);
  EXPECT_THROW(PrintBoard(kSpec, folder / "board.pdf"), ToolError);
  EXPECT_THROW(PrintBoard({2, 7, 25}, folder / "board.png"), ToolError);
}

TEST(FindBoards, NamesWhatIsWrong) {
  const TempFolder folder;
  EXPECT_THROW(FindBoards(folder / "none", kSpec, {}), ToolError);
  EXPECT_THROW(FindBoards(folder.Write("text.avi", "no video"), kSpec, {}), ToolError);
  cv::imwrite(folder / "a.png", cv::Mat(48, 64, CV_8U, cv::Scalar(9)));
  cv::imwrite(folder / "b.png", cv::Mat(64, 48, CV_8U, cv::Scalar(9)));
  try {
    FindBoards(folder.path(), kSpec, {});
    FAIL();
  } catch (const ToolError& error) {
    EXPECT_THAT(error.what(), HasSubstr("b.png: 48 x 64"));
  }
}

}  // namespace
}  // namespace viewfix
