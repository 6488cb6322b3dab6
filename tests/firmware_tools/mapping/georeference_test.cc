// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/georeference.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "firmware_tools/dataset/image_set.h"
#include "tests/firmware_tools/mapping/synthetic_map.h"
#include "tests/testing/temp_folder.h"

namespace viewfix {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

const Similarity kTruth{0.4, Eigen::Quaterniond(0.5, 0.1, -0.3, 0.8).normalized(), {10, -20, 3}};

// Pairs "p0", "p1", ... at random places of a 20 m hall, with noise in site coordinates.
std::vector<ControlPair> Pairs(int count, double noise, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<ControlPair> pairs;
  for (int i = 0; i < count; ++i) {
    ControlPair& pair = pairs.emplace_back();
    pair.name = std::string("p") + static_cast<char>('0' + i);
    pair.point_in_map = 20 * Eigen::Vector3d(normal(random), normal(random), normal(random));
    const Eigen::Vector3d error(normal(random), normal(random), normal(random));
    pair.point_in_site = kTruth * pair.point_in_map + noise * error;
  }
  return pairs;
}

// Along a straight corridor of 20 m, level on the site, at most `width` beside its middle.
std::vector<ControlPair> CorridorPairs(double width, double noise) {
  auto pairs = Pairs(10, noise, 4);
  for (int i = 0; i < 10; ++i) {
    const Eigen::Vector3d error = pairs[i].point_in_site - kTruth * pairs[i].point_in_map;
    const Eigen::Vector3d in_site(5 + 2 * i, 3 + width * ((i * 7) % 5 - 2) / 2, 1.5);
    pairs[i].point_in_map = Inverse(kTruth) * in_site;
    pairs[i].point_in_site = in_site + error;
  }
  return pairs;
}

Gravity TrueGravity() { return {kTruth.rotation.conjugate() * Eigen::Vector3d::UnitZ(), {}}; }

std::string ErrorOf(const std::vector<ControlPair>& pairs, const Gravity& gravity = {}) {
  try {
    FitGeoreference(pairs, gravity);
  } catch (const ToolError& error) {
    return error.what();
  }
  return "no error";
}

void ExpectNear(const Similarity& a, const Similarity& b, double tolerance) {
  EXPECT_NEAR(a.scale / b.scale, 1, tolerance);
  EXPECT_LT(a.rotation.angularDistance(b.rotation), tolerance);
  EXPECT_LT((a.translation - b.translation).norm(), 20 * tolerance);
}

TEST(FitGeoreference, ExactPairsGiveTheSimilarity) {
  for (const int count : {3, 4, 10}) {
    const Georeference fit = FitGeoreference(Pairs(count, 0, 1));
    ExpectNear(fit.site_from_map, kTruth, 1e-7);
    EXPECT_LT(fit.median_metres, 1e-9);
  }
}

TEST(FitGeoreference, OutliersAreLeftOutAndNamed) {
  for (const int count : {8, 60}) {  // all triples; drawn triples
    auto pairs = Pairs(count, 0.02, 2);
    for (int i = 0; i < count * 3 / 10; ++i) pairs[3 * i].point_in_site.x() += 4 + i;
    const Georeference fit = FitGeoreference(pairs);
    ExpectNear(fit.site_from_map, kTruth, 0.01);
    EXPECT_FALSE(fit.residuals[0].is_inlier);
    EXPECT_NEAR(fit.residuals[0].metres, 4, 0.3);
    EXPECT_TRUE(fit.residuals[1].is_inlier);
    EXPECT_THAT(DescribeResiduals(fit), HasSubstr("(left out), p1 0.0"));
    const Georeference again = FitGeoreference(pairs);
    EXPECT_EQ(fit.site_from_map.translation, again.site_from_map.translation);
  }
}

TEST(FitGeoreference, RefusesWhatDoesNotFit) {
  EXPECT_THAT(ErrorOf({}), HasSubstr("the map has 0"));
  EXPECT_THAT(ErrorOf(Pairs(2, 0, 1)), AllOf(HasSubstr("the map has 2"), HasSubstr("p0, p1")));
  auto line = Pairs(6, 0, 1);
  for (int i = 0; i < 6; ++i) {
    line[i].point_in_map = Eigen::Vector3d(i, 2 * i, 1);
    line[i].point_in_site = kTruth * line[i].point_in_map;
  }
  EXPECT_THAT(ErrorOf(line), AllOf(HasSubstr("on a line"), HasSubstr("p0, p1, p2, ...")));
  auto wild = Pairs(8, 0, 1);
  for (int i = 0; i < 4; ++i) wild[2 * i].point_in_site.y() += 7 * (i + 1);
  EXPECT_THAT(ErrorOf(wild), AllOf(HasSubstr("only 4 of 8"), HasSubstr("worst: p6 2")));
  auto mirrored = Pairs(8, 0, 1);
  for (ControlPair& pair : mirrored) pair.point_in_site.x() *= -1;
  EXPECT_THAT(ErrorOf(mirrored), HasSubstr("do not fit the map"));
  EXPECT_THAT(ErrorOf(Pairs(8, 0.2, 1)), HasSubstr("median"));
}

TEST(FitGeoreference, PointsOnALineAreTurnedUprightByTheCameras) {
  const Georeference line = FitGeoreference(CorridorPairs(0, 0), TrueGravity());
  EXPECT_TRUE(line.upright_by_cameras);
  ExpectNear(line.site_from_map, kTruth, 1e-7);
  // Here the points do say how the map is turned about the line, but degrees wrong.
  const auto narrow = CorridorPairs(0.18, 0.09);
  std::vector<Eigen::Vector3d> a, b;
  for (const ControlPair& pair : narrow) {
    a.push_back(pair.point_in_map);
    b.push_back(pair.point_in_site);
  }
  const auto up_of = [](const Similarity& s) {
    return std::acos((s.rotation * *TrueGravity().up_in_map).z());
  };
  const auto by_points = FitSimilarity(a, b);
  ASSERT_TRUE(by_points);
  EXPECT_GT(up_of(*by_points), 0.04);
  const Georeference fit = FitGeoreference(narrow, TrueGravity());
  EXPECT_TRUE(fit.upright_by_cameras);
  EXPECT_LT(up_of(fit.site_from_map), 0.01);
  ExpectNear(fit.site_from_map, kTruth, 0.02);
}

TEST(FitGeoreference, ALineWithoutUprightCamerasIsRefused) {
  for (const auto& pairs : {CorridorPairs(0, 0), CorridorPairs(0.18, 0.09)}) {
    EXPECT_THAT(ErrorOf(pairs, {std::nullopt, "the cameras roll too much"}),
                AllOf(HasSubstr("nearly on a line, p0, p1, p2, ..."), HasSubstr("roll too much"),
                      HasSubstr("beside the line")));
  }
  auto shaft = CorridorPairs(0, 0);
  for (ControlPair& pair : shaft) {
    pair.point_in_site = Eigen::Vector3d(1, 2, pair.point_in_site.x());
    pair.point_in_map = Inverse(kTruth) * pair.point_in_site;
  }
  EXPECT_THAT(ErrorOf(shaft, TrueGravity()), HasSubstr("stands about upright"));
}

// Every three points that are not on the line hold the wrong one; upright, the line finds itself.
TEST(FitGeoreference, ALineWithAnOutlierBesideIt) {
  auto pairs = CorridorPairs(0, 0);
  pairs[3].point_in_site.y() += 6;
  pairs[3].point_in_map = Inverse(kTruth) * (pairs[3].point_in_site + Eigen::Vector3d(0, 0, 5));
  const Georeference fit = FitGeoreference(pairs, TrueGravity());
  ExpectNear(fit.site_from_map, kTruth, 1e-7);
  EXPECT_FALSE(fit.residuals[3].is_inlier);
  EXPECT_TRUE(fit.residuals[4].is_inlier);
}

// Tags on the walls of a corridor, placed to a millimetre, know better than the cameras.
TEST(FitGeoreference, ANarrowFieldOfGoodPointsNeedsNoCameras) {
  Gravity tilted = TrueGravity();
  tilted.up_in_map = Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX()) * *tilted.up_in_map;
  const Georeference fit = FitGeoreference(CorridorPairs(0.6, 0.001), tilted);
  EXPECT_FALSE(fit.upright_by_cameras);
  ExpectNear(fit.site_from_map, kTruth, 0.005);
}

TEST(FitSimilarity, NeverMirrors) {
  const auto pairs = Pairs(9, 0, 3);
  std::vector<Eigen::Vector3d> a, b;
  for (const ControlPair& pair : pairs) {
    a.push_back(pair.point_in_map);
    b.emplace_back(-pair.point_in_map);
  }
  const auto fit = FitSimilarity(a, b);
  if (fit) {
    EXPECT_GT(fit->rotation.toRotationMatrix().determinant(), 0);
  }
}

TEST(Transform, MovesPointsAndCamerasAlike) {
  Reconstruction map = SyntheticMap(1);
  const Reconstruction before = map;
  Transform(map, kTruth);
  for (const MapImage& image : map.images) {
    for (std::size_t k = 1; k < image.keypoints.size(); ++k) {
      const Eigen::Vector3d in_cam = image.cam_from_world * map.points[image.point_idx[k]].position;
      const Eigen::Vector2d pixel = TextbookPixel(map.cameras[image.camera_idx], in_cam);
      EXPECT_LT((pixel - image.keypoints[k]).norm(), 1e-8);
    }
  }
  EXPECT_TRUE(map.points[5].position.isApprox(kTruth * before.points[5].position, 1e-12));
}

TEST(Gravity, IsWhatLevelCamerasAgreeOn) {
  Reconstruction map = SyntheticMap(1);
  EXPECT_NEAR(EstimateGravity(map).up_in_map->z(), 1, 1e-9);
  Transform(map, kTruth);
  const Gravity gravity = EstimateGravity(map);
  ASSERT_TRUE(gravity.up_in_map.has_value()) << gravity.cause;
  Transform(map, LevelFromMap(*gravity.up_in_map));
  EXPECT_NEAR(EstimateGravity(map).up_in_map->z(), 1, 1e-9);
}

TEST(Gravity, SaysWhyThereIsNone) {
  Reconstruction map = SyntheticMap(1);
  Reconstruction one_way = map;
  for (MapImage& image : one_way.images)
    image.cam_from_world.rotation = PoseOnCircle(0, 0).rotation;
  EXPECT_THAT(EstimateGravity(one_way).cause, HasSubstr("one direction"));
  Reconstruction rolling = map;
  for (std::size_t i = 0; i < rolling.images.size(); ++i) {
    const Eigen::AngleAxisd roll(1.1 * static_cast<double>(i), Eigen::Vector3d::UnitZ());
    Rigid3& pose = rolling.images[i].cam_from_world;
    pose.rotation = Eigen::Quaterniond(roll) * pose.rotation;
  }
  EXPECT_FALSE(EstimateGravity(rolling).up_in_map.has_value());
  map.images.resize(2);
  EXPECT_THAT(EstimateGravity(map).cause, HasSubstr("fewer"));
}

TEST(Gravity, SeesMirroredPlansOfPointsAtOneHeight) {
  const Reconstruction map = SyntheticMap(1);
  std::vector<ControlPair> pairs;
  for (int i = 0; i < 5; ++i) {
    const Eigen::Vector3d point(i % 3, i * i, 1);
    pairs.push_back({std::string("p"), point, point});
  }
  EXPECT_FALSE(IsUpsideDown(map, FitGeoreference(pairs).site_from_map));
  for (ControlPair& pair : pairs) pair.point_in_site.x() *= -1;
  EXPECT_TRUE(IsUpsideDown(map, FitGeoreference(pairs).site_from_map));
}

TEST(ControlFile, PairsByPathNameOrStem) {
  const TempFolder folder;
  const auto controls = ReadControlFile(folder.Write(
      "c.csv", "x,name,z,y,note\n1,walk/a.jpg,3,2.5,hi\n4,b.jpg,6,5,\n7,c,9,8,\n7,zzz,9,8,\n"));
  ASSERT_EQ(controls.size(), 4U);
  EXPECT_EQ(controls[0].point_in_site, Eigen::Vector3d(1, 2.5, 3));
  const Reconstruction map = SyntheticMap(1);
  const auto pairs = PairWithCameras(map, controls);
  ASSERT_EQ(pairs.size(), 3U);
  EXPECT_TRUE(pairs[2].point_in_map.isApprox(Inverse(map.images[2].cam_from_world).translation));
}

TEST(ControlFile, NamesWhatIsWrong) {
  const std::pair<const char*, const char*> cases[] = {
      {"name,x,y\na,1,2\n", "no column called z"},
      {"name,x,y,z\na,1,2,3\nb,1,,3\n", "line 3: an empty coordinate"},
      {"name,x,y,z\na,1,2,nan\n", "line 2: not a number: nan"},
      {"name,x,y,z\na,1,2,1e300\n", "line 2: not a coordinate"},
      {"name,x,y,z\na,1,2 3,4\n", "line 2: not a coordinate"},
      {"name,x,y,z\n,1,2,3\n", "line 2: no name"},
      {"name,x,y,z\na,1,2,3\na,1,2,3\n", "line 3: a stands in line 2 too"},
  };
  const TempFolder folder;
  for (const auto& [text, cause] : cases) {
    try {
      ReadControlFile(folder.Write("c.csv", std::string_view(text)));
      FAIL() << text;
    } catch (const ToolError& error) {
      EXPECT_THAT(error.what(), AllOf(HasSubstr("c.csv"), HasSubstr(cause)));
    }
  }
}

}  // namespace
}  // namespace viewfix
