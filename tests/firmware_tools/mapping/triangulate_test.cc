// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/triangulate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <set>

#include "firmware_tools/mapping/map_points.h"
#include "firmware_tools/mapping/point_solver.h"
#include "firmware_tools/mapping/rolling_shutter.h"
#include "firmware_tools/mapping/tracks.h"
#include "tests/firmware_tools/mapping/synthetic_scene.h"

namespace viewfix {
namespace {

std::vector<VerifiedPair> Pairs(const MapInput& input, int window) {
  std::vector<FramePair> pairs;
  const int n = static_cast<int>(input.frames.size());
  for (int a = 0; a < n; ++a) {
    for (int b = a + 1; b < n && b <= a + window; ++b) pairs.push_back({a, b});
  }
  return VerifyPairs(input, pairs, {}, 1);
}

void ExpectConsistent(const Reconstruction& map) {
  for (std::size_t p = 0; p < map.points.size(); ++p) {
    std::set<int> images;
    for (const Observation& seen : map.points[p].track) {
      EXPECT_EQ(map.images[seen.image_idx].point_idx[seen.feature_idx], static_cast<int>(p));
      EXPECT_TRUE(images.insert(seen.image_idx).second);
    }
    EXPECT_GE(images.size(), 2);
  }
}

// Share of points that all their observations truly show, and lie where it is.
double ShareRight(const SyntheticScene& scene, const Reconstruction& map, double max_distance) {
  int right = 0;
  for (const MapPoint& point : map.points) {
    std::set<int> shown;
    for (const Observation& seen : point.track) {
      shown.insert(scene.point_of[seen.image_idx][seen.feature_idx]);
    }
    right += shown.size() == 1 && *shown.begin() >= 0 &&
             (scene.points[*shown.begin()] - point.position).norm() < max_distance;
  }
  return right / double(map.points.size());
}

TEST(TriangulateWithPoses, FindsThePointsOfAScene) {
  const SyntheticScene scene({.num_frames = 12, .num_points = 400});
  const Reconstruction map = TriangulateWithPoses(scene.input, Pairs(scene.input, 3), {}, 1);
  ExpectConsistent(map);
  const MapSummary summary = Summarize(map);
  EXPECT_EQ(summary.images, 12);
  EXPECT_GT(summary.points, 300);
  EXPECT_LT(summary.points, 410);
  EXPECT_LT(summary.mean_error_px, 0.5);
  EXPECT_GT(summary.mean_track, 6);
  EXPECT_GT(ShareRight(scene, map, 0.1), 0.98);
}

TEST(TriangulateWithPoses, CompletionFindsWhatMatchesMissed) {
  const SyntheticScene scene({.num_frames = 8});
  std::vector<VerifiedPair> pairs = Pairs(scene.input, 3);
  for (VerifiedPair& pair : pairs) {
    std::erase_if(pair.matches, [](const FeatureMatch& m) { return m.first_idx % 2 == 0; });
  }
  const auto without = TriangulateWithPoses(scene.input, pairs, {.completion_rounds = 0}, 1);
  const auto with = TriangulateWithPoses(scene.input, pairs, {.completion_rounds = 2}, 1);
  ExpectConsistent(with);
  EXPECT_GT(Summarize(with).mean_track, 1.2 * Summarize(without).mean_track);
  EXPECT_GT(ShareRight(scene, with, 0.1), 0.97);
}

TEST(TriangulateWithPoses, AdjustmentRepairsNoisyPosesInTheGivenFrame) {
  SyntheticScene scene({.num_frames = 10});
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0, 0.01);
  for (MapFrame& frame : scene.input.frames) {
    const Eigen::Vector3d turn(0.2 * noise(random), 0.2 * noise(random), 0.2 * noise(random));
    frame.cam_from_world->rotation =
        Eigen::AngleAxisd(turn.norm(), turn.normalized()) * frame.cam_from_world->rotation;
    frame.cam_from_world->translation +=
        Eigen::Vector3d(noise(random), noise(random), noise(random));
  }
  const auto error = [&](const Reconstruction& map) {
    double sum = 0;
    for (std::size_t i = 0; i < map.images.size(); ++i) {
      sum += (Inverse(map.images[i].cam_from_world).translation -
              Inverse(scene.cam_from_world[i]).translation)
                 .norm();
    }
    return sum / double(map.images.size());
  };
  TriangulateOptions options;
  const auto pairs = Pairs(scene.input, 4);
  const auto given = TriangulateWithPoses(scene.input, pairs, options, 1);
  options.adjustments = 2;
  options.adjust.position_sigma = 0.02;
  const auto adjusted = TriangulateWithPoses(scene.input, pairs, options, 1);
  EXPECT_LT(error(adjusted), 0.7 * error(given));
  EXPECT_LT(Summarize(adjusted).mean_error_px, Summarize(given).mean_error_px);
}

TEST(TriangulateWithPoses, IsTheSameOnAnyNumberOfThreads) {
  const SyntheticScene scene({.num_frames = 6});
  const auto pairs = Pairs(scene.input, 3);
  const auto one = TriangulateWithPoses(scene.input, pairs, {.adjustments = 1}, 1);
  const auto three = TriangulateWithPoses(scene.input, pairs, {.adjustments = 1}, 3);
  ASSERT_EQ(one.points.size(), three.points.size());
  for (std::size_t p = 0; p < one.points.size(); ++p) {
    EXPECT_EQ(one.points[p].position, three.points[p].position);
    EXPECT_EQ(one.points[p].track, three.points[p].track);
  }
}

TEST(TriangulateWithPoses, SaysWhenThereIsNothingToDo) {
  const SyntheticScene scene({.num_frames = 3});
  EXPECT_THROW(TriangulateWithPoses(scene.WithoutPoses(), {}, {}, 1), ToolError);
  EXPECT_THROW(TriangulateWithPoses(scene.input, {}, {}, 1), ToolError);
}

TEST(Adjust, FindsTheFocalLength) {
  SyntheticScene scene({.num_frames = 10});
  const auto pairs = Pairs(scene.input, 4);
  scene.input.cameras[0].fx *= 1.01;
  scene.input.cameras[0].fy *= 1.01;
  TriangulateOptions options{.max_error_px = 8, .adjustments = 3};
  options.adjust.focal = true;
  const auto map = TriangulateWithPoses(scene.input, pairs, options, 1);
  EXPECT_NEAR(map.cameras[0].fx, 500, 1);
}

// The camera centres' distance from the truth, root mean square, once aligned.
double CentreError(const SyntheticScene& scene, const Reconstruction& map) {
  Eigen::Matrix3Xd found(3, map.images.size()), truth(3, map.images.size());
  for (std::size_t i = 0; i < map.images.size(); ++i) {
    found.col(i) = Inverse(map.images[i].cam_from_world).translation;
    truth.col(i) = Inverse(scene.cam_from_world[i]).translation;
  }
  const Eigen::Matrix4d truth_from_found = Eigen::umeyama(found, truth, true);
  const Eigen::Matrix3Xd rest =
      (truth_from_found * found.colwise().homogeneous()).topRows(3) - truth;
  return std::sqrt(rest.squaredNorm() / double(rest.cols()));
}

TEST(Adjust, FindsTheReadoutOfARollingShutter) {
  const SyntheticScene scene({.num_frames = 20, .readout = 0.4});
  const auto pairs = Pairs(scene.input, 4);
  TriangulateOptions options{.max_error_px = 8, .adjustments = 2};
  const auto bent = TriangulateWithPoses(scene.input, pairs, options, 1);
  options.adjust.readout = true;
  const auto map = TriangulateWithPoses(scene.input, pairs, options, 1);
  EXPECT_EQ(bent.images[5].readout, 0);
  EXPECT_NEAR(map.images[5].readout, 0.4, 0.05);
  EXPECT_LT(Summarize(map).mean_error_px, 0.7 * Summarize(bent).mean_error_px);
  EXPECT_LT(CentreError(scene, map), 0.5 * CentreError(scene, bent));
}

TEST(Adjust, FindsNoReadoutWhereAllRowsAreExposedAtOnce) {
  const SyntheticScene scene({.num_frames = 20});
  TriangulateOptions options{.adjustments = 1};
  options.adjust.readout = true;
  const auto map = TriangulateWithPoses(scene.input, Pairs(scene.input, 4), options, 1);
  EXPECT_NEAR(map.images[5].readout, 0, 0.02);
}

TEST(SetMotions, SaysHowPointsMoveInAFrame) {
  const SyntheticScene scene({.num_frames = 9});
  Reconstruction map;
  map.images.resize(9);
  SetMotions(scene.input, map);
  const Eigen::Vector3d point(0.3, -0.4, 5);
  const Eigen::Vector3d before = scene.cam_from_world[3] * point;
  const Eigen::Vector3d after = scene.cam_from_world[5] * point;
  const Eigen::Vector3d told = map.images[4].motion.OfPoint(scene.cam_from_world[4] * point);
  EXPECT_LT((told - (after - before) / 2).norm(), 0.01 * (after - before).norm());
}

TEST(SetMotions, NeighboursFarAwayTellNothing) {
  SyntheticScene scene({.num_frames = 3});
  scene.input.frames[2].time = 90;
  scene.input.frames[0].capture = "another walk";
  Reconstruction map;
  map.images.resize(3);
  SetMotions(scene.input, map);
  for (const MapImage& image : map.images) {
    EXPECT_EQ(image.motion.shift.norm(), 0);
    EXPECT_EQ(image.motion.turn.norm(), 0);
  }
}

TEST(Without, DropsImagesAndWhatOnlyTheySee) {
  const SyntheticScene scene({.num_frames = 6});
  const Reconstruction map = TriangulateWithPoses(scene.input, Pairs(scene.input, 3), {}, 1);
  const Reconstruction left = Without(map, {map.images[0].name, map.images[3].name});
  ASSERT_EQ(left.images.size(), 4);
  EXPECT_EQ(left.images[2].name, map.images[4].name);
  EXPECT_LT(left.points.size(), map.points.size());
  EXPECT_GT(left.points.size(), map.points.size() / 2);
  ExpectConsistent(left);
  EXPECT_EQ(Without(map, {}).points.size(), map.points.size());
}

TEST(BuildTracks, KeepsKeyPointsOfOneFrameApart) {
  const SyntheticScene scene({.num_frames = 3, .num_points = 20});
  // 0:0 - 1:0 - 2:0, and a poorer link 1:0 - 2:1 with 0:1 - 2:1.
  const std::vector<VerifiedPair> pairs = {
      {{0, 1}, {{0, 0, 10}}, {}, 0},
      {{0, 2}, {{1, 1, 20}}, {}, 0},
      {{1, 2}, {{0, 0, 11}, {0, 1, 90}}, {}, 0},
  };
  const auto tracks = BuildTracks(scene.input, pairs);
  using Track = std::vector<Observation>;
  EXPECT_THAT(tracks, ::testing::UnorderedElementsAre(Track{{0, 0}, {1, 0}, {2, 0}},
                                                      Track{{0, 1}, {2, 1}}));
}

TEST(SolvePoint, FindsThePointAmongWrongViews) {
  const SyntheticScene scene({.num_frames = 8});
  const Eigen::Vector3d truth(0.3, 0.2, 5);
  std::vector<PointView> views;
  for (int f = 0; f < 8; ++f) {
    Eigen::Vector2d pixel;
    ASSERT_TRUE(scene.input.cameras[0].Project(scene.cam_from_world[f] * truth, pixel));
    if (f % 3 == 0) pixel += Eigen::Vector2d(40, -25 * f);
    views.push_back(MakePointView(scene.input.cameras[0], scene.cam_from_world[f], pixel, 4));
  }
  const auto solved = SolvePoint(views, 0.02);
  ASSERT_TRUE(solved);
  EXPECT_LT((solved->position - truth).norm(), 1e-6);
  EXPECT_THAT(solved->inliers, ::testing::ElementsAre(1, 2, 4, 5, 7));
  EXPECT_FALSE(SolvePoint(views, 1.5)) << "no two rays meet at such an angle";
}

}  // namespace
}  // namespace viewfix
