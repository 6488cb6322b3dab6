// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/model_export.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "firmware_tools/dataset/tool_file.h"
#include "firmware_tools/mapping/colmap_model.h"
#include "models/model_writer.h"
#include "tests/testing/run_program.h"
#include "tests/testing/temp_folder.h"
#include "tests/testing/tiny_model.h"

namespace viewfix {
namespace {

using ::testing::HasSubstr;

class ModelExportTest : public ::testing::Test {
 protected:
  // A model of two maps, or with the first one only.
  void Open(int maps) {
    ModelData data = TinyModelData();
    AddTinyMaps(data);
    if (maps == 1) OneMap(data);
    file_ = *WriteModel(data);
    model_ = *ModelView::Open(file_);
  }

  static void OneMap(ModelData& data) {
    data.map_begin = {0, 40};
    data.map_origin.pop_back();
    data.map_step.pop_back();
    data.map_metric.clear();
  }

  std::vector<std::uint8_t> file_;
  ModelView model_;
  TempFolder folder_;
};

TEST_F(ModelExportTest, MapsHoldWhatTheModelHolds) {
  Open(2);
  const std::vector<Reconstruction> maps = MapsOfModel(model_);
  ASSERT_EQ(maps.size(), 2U);
  EXPECT_EQ(maps[0].images.size(), 2U);
  EXPECT_EQ(maps[1].points.size(), 20U);
  const ModelLandmarks& landmarks = model_.landmarks();
  const double x = double{landmarks.map_origin[3]} +
                   double{landmarks.map_step[1]} * landmarks.position[std::size_t{25} * 3];
  EXPECT_EQ(maps[1].points[5].position.x(), x);
  const Eigen::Vector3d centre = Inverse(maps[1].images[0].cam_from_world).translation;
  EXPECT_NEAR(centre.x(), 0.4, 1e-6);
  EXPECT_NEAR(centre.y(), -1.5, 1e-6);
}

TEST_F(ModelExportTest, ObservationsAreWhereLandmarksAreSeen) {
  Open(2);
  for (const Reconstruction& map : MapsOfModel(model_)) {
    std::size_t observations = 0;
    for (int p = 0; p < static_cast<int>(map.points.size()); ++p) {
      for (const Observation& o : map.points[p].track) {
        const MapImage& image = map.images[o.image_idx];
        EXPECT_EQ(image.point_idx[o.feature_idx], p);
        Eigen::Vector2d pixel;
        ASSERT_TRUE(map.cameras[0].Project(image.cam_from_world * map.points[p].position, pixel));
        EXPECT_EQ(pixel, image.keypoints[o.feature_idx]);
        ++observations;
      }
    }
    EXPECT_GT(observations, 20U);
  }
}

TEST_F(ModelExportTest, SeveralMapsAreNumbered) {
  Open(2);
  const auto folders = ExportModel(model_, ExportFormat::kColmap, folder_ / "map");
  ASSERT_EQ(folders.size(), 2U);
  EXPECT_EQ(folders[1], folder_ / "map/1");
  EXPECT_EQ(ReadColmapModel(folders[1]).points.size(), 20U);
  const auto clouds = ExportModel(model_, ExportFormat::kPly, folder_ / "map.ply");
  EXPECT_EQ(clouds[0], folder_ / "map-0.ply");
  EXPECT_THAT(ReadTextFile(clouds[0]), HasSubstr("element vertex 20\n"));
}

TEST_F(ModelExportTest, OneMapGoesWhereItIsTold) {
  Open(1);
  EXPECT_EQ(ExportModel(model_, ExportFormat::kTum, folder_ / "map.tum")[0], folder_ / "map.tum");
}

TEST_F(ModelExportTest, ColmapReadsIt) {
  if (std::string(COLMAP).empty()) GTEST_SKIP() << "colmap is not installed";
  Open(1);
  const auto folder = ExportModel(model_, ExportFormat::kColmap, folder_ / "map")[0];
  const ProgramRun run = RunProgram(
      {"/bin/sh", "-c", "\"$0\" model_analyzer --path \"$1\" 2>&1", COLMAP, folder.string()});
  EXPECT_EQ(run.exit_code, 0) << run.out;
  EXPECT_THAT(run.out, HasSubstr("Images: 4"));
  EXPECT_THAT(run.out, HasSubstr("Points: 40"));
}

TEST_F(ModelExportTest, WithoutLandmarksThereIsNothing) {
  file_ = TinyModel();
  model_ = *ModelView::Open(file_);
  EXPECT_TRUE(ExportModel(model_, ExportFormat::kTum, folder_ / "map.tum").empty());
}

}  // namespace
}  // namespace viewfix
