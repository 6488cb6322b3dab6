// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/dataset/calibration_file.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "tests/testing/temp_folder.h"

namespace viewfix {
namespace {

TEST(CalibrationFile, CamerasComeBack) {
  const TempFolder folder;
  const Camera cameras[] = {
      {CameraModel::kPinhole, 640, 480, 500.1, 1.0 / 3, 319.5, 239.5, {}},
      {CameraModel::kBrownConrady, 640, 480, 500, 501, 1, 2, {0.1, 0, 0, 0}},
      {CameraModel::kBrownConrady, 640, 480, 500, 501, 1, 2, {1, 2, 3, 4, 5, 6, 7, 1e-30}},
      {CameraModel::kKannalaBrandt, 640, 480, 500, 501, 1, 2, {}}};
  for (const Camera& camera : cameras) {
    SaveCalibration(ToCalibration(camera), folder / "c.yaml");
    EXPECT_EQ(ToCamera(LoadCalibration(folder / "c.yaml")), camera);
  }
}

TEST(CalibrationFile, OpenCvReadsWhatIsWritten) {
  const TempFolder folder;
  SaveCalibration({640, 480, 500.1, 1.0 / 3, 319, 239.5, {0.1, -1e-17, 0, 2.0 / 3}},
                  folder / "c.yaml");
  cv::FileStorage storage(folder / "c.yaml", cv::FileStorage::READ);
  EXPECT_EQ(static_cast<int>(storage["image_height"]), 480);
  cv::Mat k, d;
  storage["camera_matrix"] >> k;
  storage["distortion_coefficients"] >> d;
  ASSERT_EQ(k.size(), cv::Size(3, 3));
  EXPECT_EQ(k.at<double>(1, 1), 1.0 / 3);
  EXPECT_EQ(k.at<double>(0, 2), 319);
  ASSERT_EQ(d.size(), cv::Size(4, 1));
  EXPECT_EQ(d.at<double>(3), 2.0 / 3);
}

TEST(CalibrationFile, ReadsWhatOpenCvWrites) {
  const TempFolder folder;
  {
    cv::FileStorage storage(folder / "c.yml", cv::FileStorage::WRITE);
    storage << "calibration_time"
            << "Tue 22:15:03"
            << "image_width" << 640 << "image_height" << 480;
    storage << "camera_matrix" << cv::Mat(cv::Matx33d(500.25, 0, 319, 0, 501, 239.5, 0, 0, 1));
    storage << "distortion_coefficients" << (cv::Mat_<double>(5, 1) << 0.1, -2e-9, 0, 0, 3.5);
    storage << "avg_reprojection_error" << 0.25 << "list"
            << "["
            << "a"
            << "b"
            << "]";
  }
  const Calibration calibration = LoadCalibration(folder / "c.yml");
  EXPECT_EQ(calibration.fx, 500.25);
  EXPECT_EQ(calibration.distortion, (std::vector<double>{0.1, -2e-9, 0, 0, 3.5}));
}

TEST(Exif, GivesAFocalLength) {
  const auto wide = CalibrationFromExif({1, 24.0}, 4000, 3000);
  ASSERT_TRUE(wide.has_value());
  EXPECT_NEAR(wide->fx, 24.0 / 36 * 4000, 1e-9);
  EXPECT_EQ(wide->cx, 1999.5);
  EXPECT_NEAR(CalibrationFromExif({1, 24.0}, 3000, 4000)->fy, wide->fx, 1e-9) << "upright";
  EXPECT_FALSE(CalibrationFromExif({}, 4000, 3000).has_value());
  ImageSet set;
  set.cameras.push_back({640, 480, 500, 500, 1, 2, {}});
  ImageRecord image;
  EXPECT_NEAR(CalibrationOf(set, image, {1, 36.0}, 640, 480)->fx, 640, 1e-9);
  image.camera_idx = 0;
  EXPECT_EQ(CalibrationOf(set, image, {1, 36.0}, 640, 480)->fx, 500);
}

}  // namespace
}  // namespace viewfix
