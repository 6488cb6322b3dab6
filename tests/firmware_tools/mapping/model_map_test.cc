// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/model_map.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <set>

#include "tests/firmware_tools/mapping/synthetic_scene.h"
#include "tests/testing/tiny_model.h"

namespace viewfix {
namespace {

constexpr int kColumns = 6;
constexpr int kRows = 4;

// A synthetic scene as an image set with its features.
struct SceneSet {
  ImageSet set;
  FeatureStore features;
  std::vector<int> all;
  Eigen::MatrixXf similarity;

  void Add(const SyntheticScene& scene, const std::string& folder) {
    for (std::size_t f = 0; f < scene.features.size(); ++f) {
      ImageRecord image;
      image.path = folder + "/" + scene.input.frames[f].name;
      image.capture = folder;
      image.camera_idx = 0;
      const Rigid3 world_from_cam = Inverse(scene.cam_from_world[f]);
      image.pose = Pose{world_from_cam.rotation, world_from_cam.translation};
      all.push_back(static_cast<int>(set.images.size()));
      set.images.push_back(image);
      features.images.push_back(*scene.features[f]);
    }
    const Camera& camera = scene.input.cameras[0];
    set.cameras = {{camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy, {}}};
    features.dim = 64;
    const auto n = static_cast<Eigen::Index>(all.size());
    similarity = Eigen::MatrixXf::Ones(n, n);
  }

  SiteMap Map(const std::vector<int>& images, int jobs = 1) const {
    const auto n = static_cast<Eigen::Index>(images.size());
    SiteMapOptions options;
    options.jobs = jobs;
    return MapSite(set, features, images, similarity.topLeftCorner(n, n), options, {});
  }
};

// TinyModelData() has eight keyframes.
const std::vector<int> kKeyframeImages = {0, 1, 3, 5, 7, 9, 10, 11};

struct Mapped {
  SceneSet scene;
  SiteMap site;
  ModelData model = TinyModelData();
};

Mapped MakeMapped(const ModelMapOptions& options, int jobs = 1) {
  Mapped mapped;
  mapped.scene.Add(SyntheticScene({.num_frames = 12, .num_points = 500}), "walk");
  mapped.site = mapped.scene.Map(mapped.scene.all, jobs);
  AddMapToModel(mapped.site, mapped.scene.set, mapped.scene.features, kKeyframeImages, options,
                mapped.model);
  return mapped;
}

Eigen::Vector3d PositionOf(const ModelData& model, std::size_t landmark, std::size_t map) {
  Eigen::Vector3d position;
  for (int axis = 0; axis < 3; ++axis) {
    position[axis] = double{model.map_origin[map][axis]} +
                     double{model.map_step[map]} * model.landmark_position[landmark][axis];
  }
  return position;
}

// The map's point that a landmark was made of.
int PointOf(const Reconstruction& map, const Eigen::Vector3d& position) {
  int best = 0;
  for (int p = 1; p < static_cast<int>(map.points.size()); ++p) {
    if ((map.points[p].position - position).norm() <
        (map.points[best].position - position).norm()) {
      best = p;
    }
  }
  return best;
}

std::vector<std::uint32_t> LandmarksOf(const ModelData& model, std::size_t keyframe) {
  const auto begin = model.keyframe_landmarks.begin();
  return {begin + model.keyframe_landmark_begin[keyframe],
          begin + model.keyframe_landmark_begin[keyframe + 1]};
}

TEST(MapSite, TriangulatesUnderTheSetsPoses) {
  SceneSet scene;
  scene.Add(SyntheticScene({.num_frames = 12, .num_points = 500}), "walk");
  const SiteMap site = scene.Map(scene.all);
  ASSERT_EQ(site.maps.size(), 1U);
  EXPECT_TRUE(site.metric);
  EXPECT_EQ(site.maps[0].images.size(), 12U);
  EXPECT_GT(site.maps[0].points.size(), 350U);
}

TEST(MapSite, ImagesWithoutPoseOrCameraAreLeftOut) {
  SceneSet scene;
  scene.Add(SyntheticScene({.num_frames = 12, .num_points = 300}), "walk");
  scene.set.images[4].pose.reset();
  scene.set.images[7].camera_idx = -1;
  scene.features.images[9] = {};
  const SiteMap site = scene.Map(scene.all);
  ASSERT_EQ(site.maps.size(), 1U);
  EXPECT_EQ(site.maps[0].images.size(), 9U);
  for (const MapImage& image : site.maps[0].images) {
    EXPECT_NE(image.name, scene.set.images[4].path);
    EXPECT_NE(image.name, scene.set.images[7].path);
  }
}

TEST(MapSite, FewerThanTwoImagesAreNoMap) {
  SceneSet scene;
  scene.Add(SyntheticScene({.num_frames = 3, .num_points = 100}), "walk");
  EXPECT_TRUE(scene.Map({}).maps.empty());
  EXPECT_TRUE(scene.Map({1}).maps.empty());
  SiteMapOptions none;
  none.source = MapSource::kNone;
  EXPECT_TRUE(
      MapSite(scene.set, scene.features, scene.all, scene.similarity, none, {}).maps.empty());
  ModelData model = TinyModelData();
  AddMapToModel({}, scene.set, scene.features, kKeyframeImages, {}, model);
  EXPECT_EQ(*WriteModel(model), TinyModel());
}

TEST(AddMapToModel, PositionsAreHalfAStepOffAtMost) {
  const Mapped mapped = MakeMapped({});
  const ModelData& model = mapped.model;
  ASSERT_GT(model.landmark_position.size(), 300U);
  const Reconstruction& map = mapped.site.maps[0];
  // Exact halves are rounded either way, and floats are.
  const double most = 0.5 * double{model.map_step[0]} * (1 + 1e-6);
  for (std::size_t l = 0; l < model.landmark_position.size(); ++l) {
    const Eigen::Vector3d position = PositionOf(model, l, 0);
    const MapPoint& point = map.points[PointOf(map, position)];
    EXPECT_LE((position - point.position).cwiseAbs().maxCoeff(), most);
  }
  EXPECT_LT(double{model.map_step[0]}, 10.0 / 65535);
}

TEST(AddMapToModel, WhatItWritesIsAModel) {
  const Mapped mapped = MakeMapped({});
  const auto file = WriteModel(mapped.model);
  ASSERT_TRUE(file.ok()) << file.status().text();
  const ModelView view = *ModelView::Open(*file);
  EXPECT_TRUE(view.metric());
  EXPECT_EQ(view.camera().width, 640);
  // Key points of scale 2 with 0.3 pixels of noise.
  EXPECT_NEAR(view.landmarks().pixel_sigma, 0.15, 0.04);
  for (std::size_t k = 0; k < kKeyframeImages.size(); ++k) {
    EXPECT_EQ(view.keyframes().has_pose[k], 1);
    const Pose& pose = *mapped.scene.set.images[kKeyframeImages[k]].pose;
    EXPECT_NEAR(view.keyframes().pose[k * 7], pose.cam_in_world.x(), 1e-6);
    EXPECT_NEAR(view.keyframes().pose[k * 7 + 6], pose.world_from_cam.w(), 1e-6);
  }
}

TEST(AddMapToModel, KeyframesSeeWhatTheirImagesShow) {
  const Mapped mapped = MakeMapped({});
  const Reconstruction& map = mapped.site.maps[0];
  std::vector<std::set<std::string>> seen_by;
  for (std::size_t l = 0; l < mapped.model.landmark_position.size(); ++l) {
    seen_by.emplace_back();
    for (const Observation& o : map.points[PointOf(map, PositionOf(mapped.model, l, 0))].track) {
      seen_by.back().insert(map.images[o.image_idx].name);
    }
  }
  for (std::size_t k = 0; k < kKeyframeImages.size(); ++k) {
    const std::string& name = mapped.scene.set.images[kKeyframeImages[k]].path;
    std::vector<std::uint32_t> expected;
    for (std::uint32_t l = 0; l < seen_by.size(); ++l) {
      if (seen_by[l].contains(name)) expected.push_back(l);
    }
    EXPECT_EQ(LandmarksOf(mapped.model, k), expected);
  }
}

using Cells = std::vector<int>;

int CellOf(const Eigen::Vector2d& pixel) {
  const int column = std::clamp(static_cast<int>(pixel.x() * kColumns / 640), 0, kColumns - 1);
  const int row = std::clamp(static_cast<int>(pixel.y() * kRows / 480), 0, kRows - 1);
  return row * kColumns + column;
}

// By image, how many of the points `idxs` are seen in each part of it.
std::map<std::string, Cells> CountByCell(const Reconstruction& map, const std::set<int>& idxs) {
  std::map<std::string, Cells> count;
  for (const MapImage& image : map.images) count[image.name] = Cells(kColumns * kRows, 0);
  for (const int p : idxs) {
    for (const Observation& o : map.points[p].track) {
      const MapImage& image = map.images[o.image_idx];
      ++count[image.name][CellOf(image.keypoints[o.feature_idx])];
    }
  }
  return count;
}

TEST(AddMapToModel, EveryKeyframeKeepsLandmarksAllOverItsImage) {
  const ModelMapOptions options = {.landmarks_per_keyframe = 48};  // two a part
  const Mapped mapped = MakeMapped(options);
  const Reconstruction& map = mapped.site.maps[0];
  std::set<int> stable;
  std::set<int> chosen;
  for (int p = 0; p < static_cast<int>(map.points.size()); ++p) {
    if (map.points[p].error_px <= options.max_error_px) stable.insert(p);
  }
  for (std::size_t l = 0; l < mapped.model.landmark_position.size(); ++l) {
    chosen.insert(PointOf(map, PositionOf(mapped.model, l, 0)));
  }
  EXPECT_LT(chosen.size(), stable.size() / 2) << "a cover should be smaller";
  const auto there_are = CountByCell(map, stable);
  const auto kept = CountByCell(map, chosen);
  for (const int k : kKeyframeImages) {
    const std::string& name = mapped.scene.set.images[k].path;
    const std::vector<int>& cells = there_are.at(name);
    for (int cell = 0; cell < kColumns * kRows; ++cell) {
      EXPECT_GE(kept.at(name)[cell], std::min(2, cells[cell])) << name << " " << cell;
    }
  }
}

// Given poses, each a few centimetres off, come nearer the truth and stay in their frame.
TEST(MapSite, PosesThatAreNotSureAreAdjusted) {
  const SyntheticScene truth({.num_frames = 12, .num_points = 500});
  SceneSet scene;
  scene.Add(truth, "walk");
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0, 0.03);
  for (ImageRecord& image : scene.set.images) {
    for (double& x : image.pose->cam_in_world) x += noise(random);
  }
  SiteMapOptions options;
  options.jobs = 1;
  const auto rms = [&] {
    const SiteMap site =
        MapSite(scene.set, scene.features, scene.all, scene.similarity, options, {});
    double sum2 = 0;
    for (std::size_t i = 0; i < truth.cam_from_world.size(); ++i) {
      const Rigid3 pose = Inverse(site.maps[0].images[i].cam_from_world);
      sum2 += (pose.translation - Inverse(truth.cam_from_world[i]).translation).squaredNorm();
    }
    return std::sqrt(sum2 / static_cast<double>(truth.cam_from_world.size()));
  };
  const double given = rms();
  options.pose_sigma = 0.03;
  EXPECT_LT(rms(), 0.7 * given);
}

// Photographs of a walk may be in the map alone: no keyframe would propose what only they see.
TEST(AddMapToModel, EveryLandmarkIsSeenByAKeyframe) {
  const Mapped mapped = MakeMapped({});
  std::set<std::uint32_t> seen(mapped.model.keyframe_landmarks.begin(),
                               mapped.model.keyframe_landmarks.end());
  EXPECT_EQ(seen.size(), mapped.model.landmark_position.size());
}

TEST(AddMapToModel, DescriptorsAreMeansOfUnitLength) {
  const Mapped mapped = MakeMapped({});
  const auto& all = mapped.model.landmark_descriptors;
  ASSERT_EQ(all.size(), mapped.model.landmark_position.size() * 64);
  for (std::size_t l = 0; l * 64 < all.size(); ++l) {
    double norm2 = 0;
    for (std::size_t d = 0; d < 64; ++d) norm2 += double{1} * all[l * 64 + d] * all[l * 64 + d];
    EXPECT_NEAR(std::sqrt(norm2), 127, 3);
  }
}

// Photographs without colours have no say.
TEST(AddMapToModel, ChromaIsTheMeanOfThePhotographsThatHaveColours) {
  Mapped mapped = MakeMapped({});
  EXPECT_TRUE(mapped.model.landmark_chroma.empty());
  FeatureStore& features = mapped.scene.features;
  features.options.type = FeatureType::kSurfChroma;
  for (std::size_t i = 0; i < features.images.size(); ++i) {
    if (i % 3 == 0) continue;
    features.images[i].chroma.assign(features.images[i].keypoints.size() * kChromaDim,
                                     static_cast<std::int8_t>(i % 3 == 1 ? 30 : 50));
  }
  ModelData model = TinyModelData();
  AddMapToModel(mapped.site, mapped.scene.set, features, kKeyframeImages, {}, model);
  ASSERT_EQ(model.landmark_chroma.size(), model.landmark_position.size() * kLandmarkChromaDim);
  const auto between = std::ranges::count_if(
      model.landmark_chroma, [](std::int8_t steps) { return steps >= 4 && steps <= 6; });
  EXPECT_GT(between, std::ssize(model.landmark_chroma) * 9 / 10);
  EXPECT_GT(std::ranges::count(model.landmark_chroma, 5), between / 2);
}

TEST(AddMapToModel, OfGreyPhotographsNoChromaIsKept) {
  Mapped mapped = MakeMapped({});
  mapped.scene.features.options.type = FeatureType::kSurfChroma;
  ModelData model = TinyModelData();
  AddMapToModel(mapped.site, mapped.scene.set, mapped.scene.features, kKeyframeImages, {}, model);
  EXPECT_TRUE(model.landmark_chroma.empty());
}

TEST(AddMapToModel, TheSameBytesWithOneThreadAndTwo) {
  EXPECT_EQ(*WriteModel(MakeMapped({}, 1).model), *WriteModel(MakeMapped({}, 2).model));
}

// Two walks that have nothing in common: two maps, and keyframes of both.
TEST(AddMapToModel, KeyframesOfTwoMaps) {
  SceneSet scene;
  scene.Add(SyntheticScene({.num_frames = 8, .num_points = 300, .seed = 1}), "a");
  scene.Add(SyntheticScene({.num_frames = 6, .num_points = 200, .seed = 2}), "b");
  SiteMap site = scene.Map({0, 1, 2, 3, 4, 5, 6, 7});
  const SiteMap second = scene.Map({8, 9, 10, 11, 12, 13});
  site.maps.push_back(second.maps[0]);
  site.placements.push_back(second.placements[0]);
  site.metric = false;
  ModelData model = TinyModelData();
  const std::vector<int> keyframes = {0, 2, 4, 6, 8, 10, 12, 13};
  AddMapToModel(site, scene.set, scene.features, keyframes, {}, model);
  const auto file = WriteModel(model);
  ASSERT_TRUE(file.ok()) << file.status().text();
  const ModelView view = *ModelView::Open(*file);
  EXPECT_FALSE(view.metric());
  ASSERT_EQ(view.landmarks().num_maps, 2);
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    const auto seen = LandmarksOf(model, k);
    ASSERT_GT(seen.size(), 50U) << k;
    EXPECT_EQ(view.MapOf(seen.front()), k < 4 ? 0 : 1);
  }
}

// A map whose every point is unstable gives nothing, beside one that gives much.
TEST(AddMapToModel, AMapWithoutStablePointsIsEmpty) {
  SceneSet scene;
  scene.Add(SyntheticScene({.num_frames = 8, .num_points = 300, .seed = 1}), "a");
  scene.Add(SyntheticScene({.num_frames = 6, .num_points = 200, .seed = 2}), "b");
  SiteMap site = scene.Map({0, 1, 2, 3, 4, 5, 6, 7});
  const SiteMap second = scene.Map({8, 9, 10, 11, 12, 13});
  site.maps.push_back(second.maps[0]);
  site.placements.push_back(second.placements[0]);
  for (MapPoint& point : site.maps[1].points) point.error_px = 100;
  ModelData model = TinyModelData();
  AddMapToModel(site, scene.set, scene.features, kKeyframeImages, {}, model);
  const auto file = WriteModel(model);
  ASSERT_TRUE(file.ok()) << file.status().text();
  EXPECT_EQ(ModelView::Open(*file)->landmarks().num_maps, 2);
}

}  // namespace
}  // namespace viewfix
