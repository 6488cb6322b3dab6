// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/export.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>

#include "firmware_tools/dataset/pose_import.h"
#include "firmware_tools/dataset/tool_file.h"
#include "firmware_tools/mapping/colmap_model.h"
#include "tests/firmware_tools/mapping/synthetic_map.h"
#include "tests/testing/temp_folder.h"

namespace viewfix {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

Eigen::Vector3d CentreOf(const MapImage& image) {
  return Inverse(image.cam_from_world).translation;
}

// The last `count` vertices of a PLY.
Eigen::Vector3d Vertex(const std::string& ply, std::size_t count, std::size_t i) {
  Eigen::Vector3d vertex;
  std::memcpy(vertex.data(), ply.data() + ply.size() - (count - i) * 24, 24);
  return vertex;
}

TEST(Export, Ply) {
  const TempFolder folder;
  const Reconstruction map = SyntheticMap(1);
  Export(map, ExportFormat::kPly, folder / "map.ply");
  const std::string points = ReadTextFile(folder / "map.ply");
  EXPECT_THAT(points, StartsWith("ply\nformat binary_little_endian 1.0\nelement vertex 60\n"));
  EXPECT_EQ(Vertex(points, 60, 59), map.points[59].position);
  const std::string cameras = ReadTextFile(folder / "map-cameras.ply");
  EXPECT_THAT(cameras, HasSubstr("element vertex 12\n"));
  EXPECT_EQ(Vertex(cameras, 12, 3), CentreOf(map.images[3]));
}

TEST(Export, TumByIndexOrByTime) {
  const TempFolder folder;
  Reconstruction map = SyntheticMap(1);
  Export(map, ExportFormat::kTum, folder / "a.tum");
  EXPECT_EQ(ReadTumTrajectory(folder / "a.tum").images[11].name, "11");
  for (std::size_t i = 0; i < map.images.size(); ++i) {
    map.images[i].name = "rgb/" + std::to_string(100 + i) + ".50.png";
  }
  Export(map, ExportFormat::kTum, folder / "b.tum");
  const ImportedPoses poses = ReadTumTrajectory(folder / "b.tum");
  ASSERT_EQ(poses.images.size(), 12U);
  EXPECT_EQ(poses.images[2].name, "102.50");
  EXPECT_EQ(poses.images[2].pose.cam_in_world, CentreOf(map.images[2]));
  EXPECT_LT(poses.images[2].pose.world_from_cam.angularDistance(
                map.images[2].cam_from_world.rotation.conjugate()),
            1e-7);
}

TEST(Export, Colmap) {
  const TempFolder folder;
  Reconstruction map = SyntheticMap(1);
  Export(map, ExportFormat::kColmap, folder / "text");
  EXPECT_EQ(FindColmapModel(folder / "text"), ColmapFormat::kText);
  map.images[0].name = "a b.jpg";
  Export(map, ExportFormat::kColmap, folder / "binary");
  EXPECT_EQ(ReadColmapModel(folder / "binary").images[0].name, "a b.jpg");
}

TEST(Export, LeavesNothingWhereItCannotWrite) {
  const TempFolder folder;
  EXPECT_THROW(Export({}, ExportFormat::kPly, folder / "none/map.ply"), ToolError);
  EXPECT_THROW(Export({}, ExportFormat::kTum, folder / "none/map.tum"), ToolError);
  folder.Write("file", "");
  EXPECT_THROW(Export({}, ExportFormat::kColmap, folder / "file"), ToolError);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

}  // namespace
}  // namespace viewfix
