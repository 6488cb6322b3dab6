// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pose/pose_finder.h"

#include <gmock/gmock.h>

#include <functional>
#include <limits>

#include "tests/engine/pose/synthetic_site.h"

namespace viewfix {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// In this order, none more promising than another.
std::vector<ProposedKeyframe> Proposed(std::initializer_list<int> keyframes) {
  std::vector<ProposedKeyframe> proposed;
  for (const int k : keyframes) proposed.push_back({k, 0});
  return proposed;
}

std::vector<ProposedKeyframe> AllKeyframes() { return Proposed({0, 1, 2, 3, 4, 5, 6, 7}); }

// A finder with the bytes that its model lies in.
class Finder {
 public:
  explicit Finder(const SyntheticSite& site, const PoseFinderOptions& options = {})
      : file_(site.File()),
        model_(*ModelView::Open(file_)),
        finder_(std::move(*PoseFinder::Create(model_, options))) {}
  PoseFinder* operator->() { return &finder_; }

 private:
  std::vector<std::uint8_t> file_;
  ModelView model_;
  PoseFinder finder_;
};

double CentreError(const FoundPose& found, const Rigid3& truth) {
  return (Inverse(found.pose.cam_from_world).translation - Inverse(truth).translation).norm();
}

void ExpectAt(const FoundPose& found, const Rigid3& truth, double metres, double radians) {
  ASSERT_TRUE(found.found) << found.num_inliers;
  EXPECT_LE(CentreError(found, truth), metres);
  EXPECT_LE(found.pose.cam_from_world.rotation.angularDistance(truth.rotation), radians);
  EXPECT_TRUE(found.pose.covariance.allFinite());
}

TEST(PoseFinder, FindsThePoseAmongNoiseAndClutter) {
  SyntheticSite site;
  Finder finder(site);
  for (const double k : {0.0, 1.4, 3.5, 5.1, 7.0}) {
    const Rigid3 truth = SyntheticSite::CamFromWorld(k);
    const FeatureSet features = site.See(SyntheticSite::camera(), truth, 0);
    const FoundPose found = finder->Find(features, SyntheticSite::camera(), false, AllKeyframes());
    ExpectAt(found, truth, 0.01, 0.003);
    EXPECT_EQ(found.map_idx, 0);
    EXPECT_GE(found.num_inliers, 100);
    EXPECT_NEAR(found.keyframe_idx, k, 3);
  }
}

// Most of what is seen is wrong, and the first keyframes proposed see other landmarks.
TEST(PoseFinder, WrongKeyframesFirstAndMuchClutter) {
  SyntheticSite site(2);
  Finder finder(site);
  const Rigid3 truth = SyntheticSite::CamFromWorld(6);
  const SightOptions options = {.noise_px = 0.4, .clutter = 400, .share_seen = 0.4};
  const FeatureSet features = site.See(SyntheticSite::camera(), truth, 1, options);
  const auto wrong_first = Proposed({0, 1, 2, 6});
  const FoundPose found = finder->Find(features, SyntheticSite::camera(), false, wrong_first);
  ExpectAt(found, truth, 0.02, 0.006);
  EXPECT_EQ(found.map_idx, 1);
  EXPECT_GE(found.keyframe_idx, 4);
}

TEST(PoseFinder, MapsAreKeptApart) {
  SyntheticSite site(2);
  Finder finder(site);
  for (const int map : {0, 1}) {
    const Rigid3 truth = SyntheticSite::CamFromWorld(3.5);
    const FeatureSet features = site.See(SyntheticSite::camera(), truth, map);
    const FoundPose found = finder->Find(features, SyntheticSite::camera(), false, AllKeyframes());
    ExpectAt(found, truth, 0.02, 0.006);
    EXPECT_EQ(found.map_idx, map);
  }
}

TEST(PoseFinder, NothingIsFoundAmongRandomFeatures) {
  SyntheticSite site;
  Finder finder(site);
  for (int frame = 0; frame < 10; ++frame) {
    const FeatureSet features = site.See(SyntheticSite::camera(), SyntheticSite::CamFromWorld(3), 0,
                                         {.clutter = 600, .share_seen = 0});
    const FoundPose found = finder->Find(features, SyntheticSite::camera(), false, AllKeyframes());
    EXPECT_FALSE(found.found) << found.num_inliers;
    EXPECT_FALSE(
        finder
            ->FindNear(features, SyntheticSite::camera(), false, 0, SyntheticSite::CamFromWorld(3))
            .found);
  }
}

TEST(PoseFinder, NoKeyframesAndNoFeaturesFindNothing) {
  SyntheticSite site;
  Finder finder(site);
  const Rigid3 truth = SyntheticSite::CamFromWorld(3);
  const FeatureSet features = site.See(SyntheticSite::camera(), truth, 0);
  EXPECT_FALSE(finder->Find(features, SyntheticSite::camera(), false, {}).found);
  const FeatureSet none(SyntheticSite::kMaxFeatures, SyntheticSite::kDim);
  EXPECT_FALSE(finder->Find(none, SyntheticSite::camera(), false, AllKeyframes()).found);
  EXPECT_FALSE(finder->FindNear(none, SyntheticSite::camera(), false, 0, truth).found);
}

// Both maps hold the same things, a look-alike room.
SyntheticSite SiteOfTwins() {
  SyntheticSite site(2);
  ModelData& data = site.data();
  const std::size_t half = data.landmark_position.size() / 2;
  std::copy_n(data.landmark_position.begin(), half, data.landmark_position.begin() + half);
  std::copy_n(data.landmark_descriptors.begin(), half * SyntheticSite::kDim,
              data.landmark_descriptors.begin() + half * SyntheticSite::kDim);
  return site;
}

// The second of the maps is the fuller: of every other landmark of the first, little is said.
void HideHalfOfTheFirst(ModelData& data) {
  for (std::uint32_t l = 0; l < data.map_begin[1]; l += 2) data.landmark_rarity[l] = 20;
}

// Each pose has a rival that as many agree with.
TEST(PoseFinder, ALookAlikePlaceIsARival) {
  SyntheticSite site = SiteOfTwins();
  Finder finder(site);
  const Rigid3 truth = SyntheticSite::CamFromWorld(3.5);
  const FeatureSet features = site.See(SyntheticSite::camera(), truth, 0);
  const FoundPose found = finder->Find(features, SyntheticSite::camera(), false, AllKeyframes());
  ExpectAt(found, truth, 0.01, 0.003);
  EXPECT_GE(found.rivals[0].evidence, 0.8F * found.evidence);
  ASSERT_GE(found.rivals[0].keyframe_idx, 0);
  EXPECT_NE(found.rivals[0].keyframe_idx < 4, found.keyframe_idx < 4);
  const FoundPose alone =
      finder->Find(features, SyntheticSite::camera(), false, Proposed({0, 1, 2, 3}));
  EXPECT_EQ(alone.rivals[0].evidence, 0);
  EXPECT_EQ(alone.rivals[0].keyframe_idx, -1);
}

// More agrees with the twin whose map is the fuller, but colours are those of the other.
TEST(PoseFinder, ColoursTellLookAlikePlacesApart) {
  SyntheticSite site = SiteOfTwins();
  site.Colour();
  HideHalfOfTheFirst(site.data());
  Finder finder(site);
  const Rigid3 truth = SyntheticSite::CamFromWorld(3.5);
  FeatureSet features = site.See(SyntheticSite::camera(), truth, 0);
  const FoundPose found = finder->Find(features, SyntheticSite::camera(), false, AllKeyframes());
  ExpectAt(found, truth, 0.01, 0.003);
  EXPECT_EQ(found.map_idx, 0);
  EXPECT_GT(found.rivals[0].evidence, 0);
  EXPECT_LT(found.rivals[0].evidence, 0.5F * found.evidence);
  features.set_has_chroma(false);
  EXPECT_EQ(finder->Find(features, SyntheticSite::camera(), false, AllKeyframes()).map_idx, 1);
}

// The same of descriptors, where one in five things is not the same.
TEST(PoseFinder, WhatDiffersTellsLookAlikePlacesApart) {
  SyntheticSite site = SiteOfTwins();
  ModelData& data = site.data();
  for (std::size_t l = data.map_begin[1]; l < data.landmark_position.size(); l += 5) {
    std::int8_t* descriptor = &data.landmark_descriptors[l * SyntheticSite::kDim];
    std::transform(descriptor, descriptor + SyntheticSite::kDim, descriptor, std::negate<>());
  }
  HideHalfOfTheFirst(data);
  Finder finder(site);
  const Rigid3 truth = SyntheticSite::CamFromWorld(3.5);
  const FeatureSet features = site.See(SyntheticSite::camera(), truth, 0);
  EXPECT_EQ(finder->Find(features, SyntheticSite::camera(), false, AllKeyframes()).map_idx, 0);
}

// Scores are sure of the wrong one of two look-alike places: the other is tried if it is named as
// one, and what is given is what agrees with the better.
TEST(PoseFinder, ALookAlikePlaceIsTriedInAnyCase) {
  SyntheticSite site = SiteOfTwins();
  site.Colour();
  Finder finder(site);
  const Rigid3 truth = SyntheticSite::CamFromWorld(3.5);
  const std::vector<ProposedKeyframe> first = Proposed({0, 1, 2, 3});
  const std::vector<ProposedKeyframe> second = Proposed({4, 5, 6, 7});
  for (const int map : {0, 1}) {
    const FeatureSet features = site.See(SyntheticSite::camera(), truth, map);
    EXPECT_EQ(finder->Find(features, SyntheticSite::camera(), false, first).map_idx, 0);
    const FoundPose found = finder->Find(features, SyntheticSite::camera(), false, first, second);
    EXPECT_EQ(found.map_idx, map);
    EXPECT_EQ(finder->inliers().size(), static_cast<std::size_t>(found.num_inliers));
    EXPECT_GT(found.rivals[0].evidence, 0);
    EXPECT_LT(found.rivals[0].evidence, 0.5F * found.evidence);
  }
}

// Landmarks that were seen in grey alone have no colours that a frame's could differ from.
TEST(PoseFinder, ColoursThatAreNotKnownSayNothing) {
  SyntheticSite site = SiteOfTwins();
  site.Colour();
  ModelData& data = site.data();
  HideHalfOfTheFirst(data);
  const FeatureSet features =
      site.See(SyntheticSite::camera(), SyntheticSite::CamFromWorld(3.5), 0);
  for (std::size_t l = 0; l < data.landmark_position.size(); ++l) {
    data.landmark_chroma[l * kLandmarkChromaDim] = kNoLandmarkChroma;
  }
  Finder finder(site);
  EXPECT_EQ(finder->Find(features, SyntheticSite::camera(), false, AllKeyframes()).map_idx, 1);
}

// Far less agrees than the pose puts into the image: something like the place.
TEST(PoseFinder, ASmallShareOfWhatShouldBeSeenDoesNotConvince) {
  SyntheticSite site;
  Finder finder(site);
  Finder credulous(site, {.min_inliers = 8, .min_evidence = 5, .min_evidence_share = 0});
  Finder strict(site, {.min_inliers = 8, .min_evidence = 5, .min_evidence_share = 0.5F});
  const Rigid3 truth = SyntheticSite::CamFromWorld(3);
  const FeatureSet features = site.See(SyntheticSite::camera(), truth, 0,
                                       {.noise_px = 0.4, .clutter = 60, .share_seen = 0.2});
  const FoundPose found = credulous->Find(features, SyntheticSite::camera(), false, AllKeyframes());
  ASSERT_TRUE(found.found);
  EXPECT_LT(found.evidence, found.expected / 3);
  EXPECT_FALSE(strict->Find(features, SyntheticSite::camera(), false, AllKeyframes()).found);
}

TEST(PoseFinder, AFocalLengthThatIsAGuessIsRefined) {
  SyntheticSite site;
  Finder finder(site);
  const Rigid3 truth = SyntheticSite::CamFromWorld(2.5);
  const FeatureSet features = site.See(SyntheticSite::camera(), truth, 0);
  for (const double factor : {0.93, 1.08}) {
    Camera guess = SyntheticSite::camera();
    guess.fx *= factor;
    guess.fy *= factor;
    ExpectAt(finder->Find(features, guess, true, AllKeyframes()), truth, 0.04, 0.006);
  }
}

TEST(PoseFinder, TracksFromAPoseNearby) {
  SyntheticSite site;
  Finder finder(site);
  const Rigid3 truth = SyntheticSite::CamFromWorld(3.5);
  const FeatureSet features = site.See(SyntheticSite::camera(), truth, 0);
  const FoundPose found = finder->FindNear(features, SyntheticSite::camera(), false, 0,
                                           SyntheticSite::CamFromWorld(3.7));
  ExpectAt(found, truth, 0.01, 0.003);
  const FoundPose whole = finder->Find(features, SyntheticSite::camera(), false, AllKeyframes());
  EXPECT_LE(CentreError(found, whole.pose.cam_from_world), 0.003);
}

// From a wrong pose, or one of another map, either nothing or the right pose is found.
TEST(PoseFinder, TrackingFromAWrongPoseDoesNotLie) {
  SyntheticSite site(2);
  Finder finder(site);
  const Rigid3 truth = SyntheticSite::CamFromWorld(1);
  const FeatureSet features = site.See(SyntheticSite::camera(), truth, 0);
  const Camera camera = SyntheticSite::camera();
  for (const double k : {3.0, 5.0, 30.0, -40.0}) {
    const FoundPose found =
        finder->FindNear(features, camera, false, 0, SyntheticSite::CamFromWorld(k));
    EXPECT_TRUE(!found.found || CentreError(found, truth) <= 0.02) << k;
  }
  for (const int map : {1, 2, -1, std::numeric_limits<int>::max()}) {
    EXPECT_FALSE(finder->FindNear(features, camera, false, map, truth).found) << map;
  }
}

// A third of the landmarks come again half a metre beside: tiles. Seen from where a prediction is
// off by just that, they agree with it, and all else is out of reach.
TEST(PoseFinder, TrackingDoesNotSettleForAPartOfWhatShouldBeSeen) {
  SyntheticSite site;
  ModelData& data = site.data();
  const std::size_t third = data.landmark_position.size() / 3;
  const double shift = 0.5;
  for (std::size_t l = 0; l < third; ++l) {
    data.landmark_position[third + l] = data.landmark_position[l];
    std::int16_t& x = data.landmark_position[third + l][0];
    x = static_cast<std::int16_t>(std::min(32767.0, x + shift / double{data.map_step[0]}));
  }
  std::copy_n(data.landmark_descriptors.begin(), third * SyntheticSite::kDim,
              data.landmark_descriptors.begin() + third * SyntheticSite::kDim);
  Finder finder(site);
  const Rigid3 truth = SyntheticSite::CamFromWorld(3.5);
  const FeatureSet features = site.See(SyntheticSite::camera(), truth, 0);
  for (const double side : {-1.0, 1.0}) {
    Rigid3 predicted = truth;
    predicted.translation += truth.rotation * Eigen::Vector3d(side * shift, 0, 0);
    const FoundPose found =
        finder->FindNear(features, SyntheticSite::camera(), false, 0, predicted);
    EXPECT_FALSE(found.found) << found.evidence << " of " << found.expected << ", "
                              << CentreError(found, truth) << " m off";
  }
  ExpectAt(finder->Find(features, SyntheticSite::camera(), false, AllKeyframes()), truth, 0.01,
           0.003);
}

// What is right but weak is the whole search's to find.
TEST(PoseFinder, TrackingLeavesAWeakPoseToTheWholeSearch) {
  SyntheticSite site;
  Finder finder(site);
  Finder credulous(site, {.min_tracked_share = 0});
  const Rigid3 truth = SyntheticSite::CamFromWorld(3.5);
  const FeatureSet features = site.See(SyntheticSite::camera(), truth, 0, {.share_seen = 0.35});
  const Camera camera = SyntheticSite::camera();
  EXPECT_FALSE(finder->FindNear(features, camera, false, 0, truth).found);
  ExpectAt(credulous->FindNear(features, camera, false, 0, truth), truth, 0.02, 0.006);
  ExpectAt(finder->Find(features, camera, false, AllKeyframes()), truth, 0.02, 0.006);
}

TEST(PoseFinder, TrackingFromNumbersThatAreNoneEnds) {
  SyntheticSite site;
  Finder finder(site);
  const Rigid3 truth = SyntheticSite::CamFromWorld(1);
  const FeatureSet features = site.See(SyntheticSite::camera(), truth, 0);
  for (const double value : {kNan, std::numeric_limits<double>::infinity(), 1e300}) {
    Rigid3 broken = truth;
    broken.translation.x() = value;
    EXPECT_FALSE(finder->FindNear(features, SyntheticSite::camera(), false, 0, broken).found);
    broken = truth;
    broken.rotation.coeffs().setConstant(value);
    EXPECT_FALSE(finder->FindNear(features, SyntheticSite::camera(), false, 0, broken).found);
  }
}

TEST(PoseFinder, FramesDoNotInfluenceEachOther) {
  SyntheticSite site(2);
  Finder finder(site);
  const FeatureSet first = site.See(SyntheticSite::camera(), SyntheticSite::CamFromWorld(1), 0);
  const FeatureSet second = site.See(SyntheticSite::camera(), SyntheticSite::CamFromWorld(6), 1);
  const auto find = [&](const FeatureSet& f) {
    return finder->Find(f, SyntheticSite::camera(), false, AllKeyframes());
  };
  const FoundPose alone = find(first);
  (void)find(second);
  const FoundPose again = find(first);
  EXPECT_EQ(again.num_inliers, alone.num_inliers);
  EXPECT_EQ(again.pose.cam_from_world.translation, alone.pose.cam_from_world.translation);
  EXPECT_EQ(again.pose.cam_from_world.rotation.coeffs(),
            alone.pose.cam_from_world.rotation.coeffs());
  EXPECT_EQ(again.pose.covariance, alone.pose.covariance);
}

TEST(PoseFinder, LandmarksAllAtOnePointAreNoPose) {
  SyntheticSite site;
  const FeatureSet features = site.See(SyntheticSite::camera(), SyntheticSite::CamFromWorld(3), 0);
  for (auto& position : site.data().landmark_position) position = {0, 0, 0};
  Finder finder(site);
  const FoundPose found = finder->Find(features, SyntheticSite::camera(), false, AllKeyframes());
  EXPECT_FALSE(found.found) << found.num_inliers;
  const FeatureSet one_point = site.See(SyntheticSite::camera(), SyntheticSite::CamFromWorld(3), 0);
  (void)finder->Find(one_point, SyntheticSite::camera(), false, AllKeyframes());
  (void)finder->FindNear(one_point, SyntheticSite::camera(), false, 0,
                         SyntheticSite::CamFromWorld(3));
}

// Each landmark is seen by one keyframe: no keyframe shares any with another.
TEST(PoseFinder, KeyframesThatShareNothing) {
  SyntheticSite site;
  ModelData& data = site.data();
  data.keyframe_landmarks.clear();
  data.keyframe_landmark_begin = {0};
  const auto size = static_cast<std::uint32_t>(data.landmark_position.size());
  for (std::uint32_t k = 0; k < SyntheticSite::kKeyframes; ++k) {
    for (std::uint32_t l = k; l < size; l += SyntheticSite::kKeyframes) {
      data.keyframe_landmarks.push_back(l);
    }
    data.keyframe_landmark_begin.push_back(
        static_cast<std::uint32_t>(data.keyframe_landmarks.size()));
  }
  Finder finder(site);
  const Rigid3 truth = SyntheticSite::CamFromWorld(3);
  const FeatureSet features = site.See(SyntheticSite::camera(), truth, 0,
                                       {.noise_px = 0.4, .clutter = 60, .share_seen = 1});
  const FoundPose found = finder->Find(features, SyntheticSite::camera(), false, AllKeyframes());
  ExpectAt(found, truth, 0.03, 0.01);
}

TEST(PoseFinder, KeyframesWithoutLandmarksArePassedOver) {
  SyntheticSite site;
  ModelData& data = site.data();
  const std::uint32_t first = data.keyframe_landmark_begin[1];
  data.keyframe_landmarks.resize(first);
  data.keyframe_landmark_begin.assign(SyntheticSite::kKeyframes + 1, first);
  data.keyframe_landmark_begin[0] = 0;
  Finder finder(site);
  const Rigid3 truth = SyntheticSite::CamFromWorld(0);
  const FeatureSet features = site.See(SyntheticSite::camera(), truth, 0);
  const auto order = Proposed({3, 4, 5, 6, 7, 0});
  ExpectAt(finder->Find(features, SyntheticSite::camera(), false, order), truth, 0.01, 0.003);
}

// More landmarks than a frame is matched with: cut, not overrun.
TEST(PoseFinder, TheMostLandmarksThatFit) {
  SyntheticSite site;
  Finder finder(site, {.max_landmarks = 64, .min_inliers = 8});
  const Rigid3 truth = SyntheticSite::CamFromWorld(3);
  const FeatureSet features = site.See(SyntheticSite::camera(), truth, 0,
                                       {.noise_px = 0.4, .clutter = 60, .share_seen = 1});
  const FoundPose found = finder->Find(features, SyntheticSite::camera(), false, AllKeyframes());
  EXPECT_LE(found.num_inliers, 64);
  EXPECT_TRUE(!found.found || CentreError(found, truth) <= 0.1);
}

TEST(PoseFinder, OptionsOutOfRangeAreRefused) {
  const SyntheticSite site;
  const auto file = site.File();
  const ModelView model = *ModelView::Open(file);
  const std::vector<std::function<void(PoseFinderOptions&)>> wrong = {
      [](PoseFinderOptions& o) { o.max_landmarks = 63; },
      [](PoseFinderOptions& o) { o.max_landmarks = 65537; },
      [](PoseFinderOptions& o) { o.max_groups = 0; },
      [](PoseFinderOptions& o) { o.min_inliers = 3; },
      [](PoseFinderOptions& o) { o.max_ratio = 1.1F; },
      [](PoseFinderOptions& o) { o.max_ratio = std::numeric_limits<float>::quiet_NaN(); },
      [](PoseFinderOptions& o) { o.min_evidence_share = 1.5F; },
      [](PoseFinderOptions& o) { o.min_tracked_share = -0.1F; },
      [](PoseFinderOptions& o) { o.rival_promise = std::numeric_limits<float>::quiet_NaN(); },
      [](PoseFinderOptions& o) { o.guided_radius_px = 0; },
      [](PoseFinderOptions& o) { o.tracking_radius_px = kNan; },
      [](PoseFinderOptions& o) { o.max_guided_distance = 0; },
  };
  for (std::size_t i = 0; i < wrong.size(); ++i) {
    PoseFinderOptions options;
    wrong[i](options);
    EXPECT_FALSE(PoseFinder::Create(model, options).ok()) << i;
  }
}

TEST(PoseFinder, AModelWithoutLandmarksIsRefused) {
  const auto file = TinyModel();
  EXPECT_FALSE(PoseFinder::Create(*ModelView::Open(file), {}).ok());
}

}  // namespace
}  // namespace viewfix
