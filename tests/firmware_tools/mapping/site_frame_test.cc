// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/site_frame.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "firmware_tools/dataset/image_set.h"
#include "tests/firmware_tools/mapping/synthetic_map.h"

namespace viewfix {
namespace {

using ::testing::HasSubstr;

Similarity SiteFromMap() {
  Similarity site_from_map;
  site_from_map.scale = 2.5;
  site_from_map.rotation = Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ());
  site_from_map.translation = {10, -3, 1};
  return site_from_map;
}

Eigen::Vector3d CentreOf(const MapImage& image) {
  return Inverse(image.cam_from_world).translation;
}

// The first `count` cameras of a map, at their places on the site.
SiteControls ControlsOf(const Reconstruction& map, int count) {
  SiteControls controls;
  controls.source = "control.csv";
  for (int i = 0; i < count; ++i) {
    controls.points.push_back({map.images[i].name, SiteFromMap() * CentreOf(map.images[i])});
  }
  return controls;
}

void Tilt(Reconstruction& map, double angle) {
  Similarity tilted_from_map;
  tilted_from_map.rotation = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitX());
  Transform(map, tilted_from_map);
}

double LargestPixelError(const Reconstruction& map) {
  double largest = 0;
  for (const MapPoint& point : map.points) {
    for (const Observation& o : point.track) {
      const MapImage& image = map.images[o.image_idx];
      Eigen::Vector2d pixel;
      EXPECT_TRUE(
          map.cameras[image.camera_idx].Project(image.cam_from_world * point.position, pixel));
      largest = std::max(largest, (pixel - image.keypoints[o.feature_idx]).norm());
    }
  }
  return largest;
}

TEST(PlaceMaps, ControlsGiveMetresAndKeepPixels) {
  const Reconstruction truth = SyntheticMap(1);
  std::vector<Reconstruction> maps = {truth};
  const PlaceReport report = PlaceMaps(maps, {.controls = ControlsOf(truth, 6), .folder = {}});
  ASSERT_EQ(report.placements.size(), 1U);
  EXPECT_TRUE(report.placements[0].metric);
  EXPECT_LT(report.placements[0].fit->median_metres, 1e-9);
  EXPECT_THAT(report.notes[0], HasSubstr("walk/a.jpg 0.00 m"));
  for (std::size_t i = 0; i < truth.images.size(); ++i) {
    EXPECT_LT((CentreOf(maps[0].images[i]) - SiteFromMap() * CentreOf(truth.images[i])).norm(),
              1e-9);
  }
  EXPECT_LT(LargestPixelError(maps[0]), 1e-6);
}

TEST(PlaceMaps, TheLargestMustFit) {
  std::vector<Reconstruction> maps = {SyntheticMap(1)};
  try {
    PlaceMaps(maps, {.controls = ControlsOf(maps[0], 2), .folder = {}});
    FAIL() << "two control points were enough";
  } catch (const ToolError& error) {
    EXPECT_THAT(error.what(), HasSubstr("control.csv: three control points"));
  }
}

// Three cameras, of which the site knows places on a line: the cameras' own level does the rest.
TEST(PlaceMaps, ControlsOnALineTakeTheCamerasLevel) {
  std::vector<Reconstruction> maps = {SyntheticMap(1)};
  SiteControls controls = ControlsOf(maps[0], 0);
  for (int i = 0; i < 3; ++i) {
    Rigid3& pose = maps[0].images[i].cam_from_world;
    pose.translation = -(pose.rotation * Eigen::Vector3d(i, 0.5 * i, 0.3));
    controls.points.push_back(
        {maps[0].images[i].name, SiteFromMap() * CentreOf(maps[0].images[i])});
  }
  const Reconstruction before = maps[0];
  const PlaceReport report = PlaceMaps(maps, {.controls = controls, .folder = {}});
  EXPECT_TRUE(report.placements[0].fit->upright_by_cameras);
  EXPECT_THAT(report.notes[0], HasSubstr("nearly on a line"));
  EXPECT_LT((CentreOf(maps[0].images[8]) - SiteFromMap() * CentreOf(before.images[8])).norm(),
            1e-6);
  for (MapImage& image : maps[0].images) {  // all look one way: none knows which is up
    const Eigen::Vector3d centre = CentreOf(image);
    image.cam_from_world.rotation = PoseOnCircle(0, 0).rotation;
    image.cam_from_world.translation = -(image.cam_from_world.rotation * centre);
  }
  EXPECT_THROW(PlaceMaps(maps, {.controls = controls, .folder = {}}), ToolError);
}

TEST(PlaceMaps, UpsideDownIsRefused) {
  std::vector<Reconstruction> maps = {SyntheticMap(1)};
  SiteControls controls = ControlsOf(maps[0], 8);
  for (ControlPoint& point : controls.points) {
    point.point_in_site.y() *= -1;
    point.point_in_site.z() *= -1;
  }
  EXPECT_THROW(PlaceMaps(maps, {.controls = controls, .folder = {}}), ToolError);
}

TEST(PlaceMaps, OthersStayFreeAndAreLevelled) {
  std::vector<Reconstruction> maps = {SyntheticMap(1), SyntheticMap(2)};
  for (MapImage& image : maps[1].images) image.name = "other/" + image.name.substr(5);
  Tilt(maps[1], 0.4);
  const SiteControls controls = ControlsOf(maps[0], 5);
  const PlaceReport report = PlaceMaps(maps, {.controls = controls, .folder = {}, .level = true});
  EXPECT_TRUE(report.placements[0].metric);
  EXPECT_FALSE(report.placements[1].metric);
  EXPECT_TRUE(report.placements[1].levelled);
  ASSERT_EQ(report.warnings.size(), 1U);
  EXPECT_THAT(report.warnings[0], HasSubstr("map 1 is not in the site's coordinates"));
}

TEST(PlaceMaps, AMapWithControlsGoesBeforeALargerOneWithout) {
  std::vector<Reconstruction> maps = {SyntheticMap(1), SyntheticMap(2)};
  for (MapImage& image : maps[1].images) image.name = "other/" + image.name.substr(5);
  const PlaceReport report =
      PlaceMaps(maps, {.controls = ControlsOf(maps[1], 5), .folder = {}, .level = true});
  EXPECT_THAT(maps[0].images[0].name, testing::StartsWith("other/"));
  EXPECT_TRUE(report.placements[0].metric);
  EXPECT_FALSE(report.placements[1].metric);
}

TEST(PlaceMaps, WithoutControlsZIsUp) {
  std::vector<Reconstruction> maps = {SyntheticMap(3)};
  Tilt(maps[0], 1.1);
  const PlaceReport report = PlaceMaps(maps, {.controls = {}, .folder = {}, .level = true});
  EXPECT_FALSE(report.placements[0].metric);
  EXPECT_TRUE(report.placements[0].levelled);
  for (const MapImage& image : maps[0].images) {
    const Eigen::Vector3d right = Inverse(image.cam_from_world).rotation * Eigen::Vector3d::UnitX();
    EXPECT_NEAR(right.z(), 0, 1e-6);
  }
  EXPECT_LT(LargestPixelError(maps[0]), 1e-6);
}

TEST(PlaceMaps, WhatCannotBeLevelledIsSaid) {
  std::vector<Reconstruction> maps = {SyntheticMap(3)};
  maps[0].images.resize(2);
  const PlaceReport report = PlaceMaps(maps, {.controls = {}, .folder = {}, .level = true});
  EXPECT_FALSE(report.placements[0].levelled);
  EXPECT_THAT(report.warnings[0], HasSubstr("map 0 is not level: fewer than three"));
}

TEST(PlaceMaps, GivenPosesStayAsTheyAre) {
  const Reconstruction truth = SyntheticMap(4);
  std::vector<Reconstruction> maps = {truth};
  const PlaceReport report =
      PlaceMaps(maps, {.controls = {}, .folder = {}, .given_is_metric = true});
  EXPECT_TRUE(report.placements[0].metric);
  EXPECT_EQ(maps[0].points[7].position, truth.points[7].position);
}

}  // namespace
}  // namespace viewfix
