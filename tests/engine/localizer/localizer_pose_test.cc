// SPDX-License-Identifier: BSD-3-Clause
// Localizer with a model that has landmarks.
#include <gmock/gmock.h>

#include <algorithm>
#include <functional>
#include <limits>

#include "engine/localizer.h"
#include "tests/testing/landmark_site.h"

namespace viewfix {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

class LocalizerPoseTest : public ::testing::Test {
 protected:
  Localizer Make() {
    file_ = *WriteModel(site_.data);
    model_ = *ModelView::Open(file_);
    auto localizer = Localizer::Create(model_, {});
    EXPECT_TRUE(localizer.ok()) << localizer.status().text();
    return std::move(*localizer);
  }
  ImageView image() const { return {site_.pixels.data(), site_.width, site_.height, site_.width}; }
  // Rows of the middle: another shape than the camera's.
  ImageView strip() const {
    return {site_.pixels.data() + 30 * site_.width, site_.width, 180, site_.width};
  }

  void ExpectPose(const Result<Fix>& fix, double metres, double radians) const {
    ASSERT_TRUE(fix.ok()) << fix.status().text();
    ASSERT_TRUE(fix->has_pose) << fix->num_inliers;
    EXPECT_TRUE(fix->localized);
    EXPECT_EQ(fix->reasons, 0U);
    EXPECT_LE((fix->world_from_cam.translation - site_.world_from_cam.translation).norm(), metres);
    EXPECT_LE(fix->world_from_cam.rotation.angularDistance(site_.world_from_cam.rotation), radians);
    const ModelScoring& scoring = model_.scoring();
    EXPECT_EQ(fix->map_idx, 0);
    EXPECT_EQ(model_.keyframes().pair[fix->keyframe_idx], fix->pair_idx);
    EXPECT_EQ(scoring.pair_location[fix->pair_idx], fix->location_idx);
    for (int i = 0; i < fix->num_rivals; ++i) EXPECT_NE(fix->rivals[i], fix->location_idx);
    EXPECT_TRUE(fix->covariance.allFinite());
    EXPECT_EQ(fix->covariance, fix->covariance.transpose());
    EXPECT_GT(fix->covariance.diagonal().minCoeff(), 0);
  }

  // All but one, where so said.
  void AllKeyframesSeeAll(int but = -1) {
    ModelData& data = site_.data;
    data.keyframe_landmark_begin = {0};
    data.keyframe_landmarks.clear();
    for (std::size_t k = 0; k < data.keyframe_pair.size(); ++k) {
      data.keyframe_has_pose[k] = 1;
      data.keyframe_pose[k] = {0, 0, 0, 0, 0, 0, 1};
      for (std::uint32_t l = 0; l < data.landmark_position.size(); ++l) {
        if (static_cast<int>(k) != but) data.keyframe_landmarks.push_back(l);
      }
      data.keyframe_landmark_begin.push_back(
          static_cast<std::uint32_t>(data.keyframe_landmarks.size()));
    }
  }

  // Its keyframes, the fourth and those after it, see no landmarks.
  void LeaveOutTheSecondLocation() {
    auto& begin = site_.data.keyframe_landmark_begin;
    site_.data.keyframe_landmarks.resize(begin[4]);
    std::fill(begin.begin() + 5, begin.end(), begin[4]);
  }

  LandmarkSite site_ = MakeLandmarkSite();
  std::vector<std::uint8_t> file_;
  ModelView model_;
};

TEST_F(LocalizerPoseTest, FindsWhereThePhotographWasTaken) {
  Localizer localizer = Make();
  const auto fix = localizer.Localize(image());
  ExpectPose(fix, 0.005, 0.002);
  EXPECT_GT(fix->num_inliers, 80);
  EXPECT_GT(fix->confidence, 0.9F);
}

TEST_F(LocalizerPoseTest, TheKeyPointsThatAgreeAreToBeSeen) {
  Localizer localizer = Make();
  const auto fix = localizer.Localize(image());
  ASSERT_TRUE(fix.ok());
  const auto matched = [](const SeenPoint& point) { return point.matched; };
  const auto points = localizer.SeenPoints();
  EXPECT_EQ(static_cast<int>(points.size()), fix->num_features);
  // Two key points may lie at one place.
  EXPECT_GE(std::count_if(points.begin(), points.end(), matched), fix->num_inliers);
  for (const SeenPoint& point : points) {
    EXPECT_TRUE(point.x > -1 && point.x < static_cast<float>(site_.width));
    EXPECT_TRUE(point.y > -1 && point.y < static_cast<float>(site_.height));
    EXPECT_GT(point.radius_px, 0);
  }
  // Nothing is left of the frame before, in one of another place, or of none.
  std::vector<std::uint8_t> mirrored = site_.pixels;
  for (auto row = mirrored.begin(); row != mirrored.end(); row += site_.width) {
    std::reverse(row, row + site_.width);
  }
  const auto other = localizer.Localize({mirrored.data(), site_.width, site_.height, site_.width});
  ASSERT_TRUE(other.ok());
  ASSERT_FALSE(other->has_pose);
  const auto others = localizer.SeenPoints();
  EXPECT_GT(others.size(), 100U);
  EXPECT_EQ(std::count_if(others.begin(), others.end(), matched), 0);
  const std::vector<std::uint8_t> plain(site_.pixels.size(), 128);
  ASSERT_TRUE(localizer.Localize({plain.data(), site_.width, site_.height, site_.width}).ok());
  EXPECT_EQ(localizer.SeenPoints().size(), 0U);
}

TEST_F(LocalizerPoseTest, ACameraGivenReplacesTheModels) {
  site_.data.camera.intrinsics[0] = site_.data.camera.intrinsics[1] = 150;
  Localizer localizer = Make();
  ExpectPose(localizer.Localize(image(), {.camera = &site_.camera}), 0.005, 0.002);
  // At twice the size: of the same shape.
  const Camera twice = site_.camera.ResizedTo(640, 480);
  ExpectPose(localizer.Localize(image(), {.camera = &twice}), 0.005, 0.002);
}

TEST_F(LocalizerPoseTest, AnImageOfAnotherShapeGetsItsFocalLengthRefined) {
  for (const double factor : {1.0, 0.94, 1.06}) {
    site_.data.camera.intrinsics[0] = site_.data.camera.intrinsics[1] = 280 * factor;
    Localizer localizer = Make();
    ExpectPose(localizer.Localize(strip()), 0.05, 0.01);
  }
}

TEST_F(LocalizerPoseTest, APriorCameraThatIsWrongIsAnError) {
  Localizer localizer = Make();
  const std::vector<std::function<void(Camera&)>> wrong = {
      [](Camera& c) { c.fx = 0; },
      [](Camera& c) { c.fy = kNan; },
      [](Camera& c) { c.width = 0; },
      [](Camera& c) { c.height = -240; },
      [](Camera& c) { c.height = 320; },
      [](Camera& c) { c.width = 240, c.height = 320; },
      [](Camera& c) { c.cx = 1 / 0.0; },
      [](Camera& c) { c.model = static_cast<CameraModel>(9); },
      [](Camera& c) { c.distortion[7] = kNan; },
  };
  for (std::size_t i = 0; i < wrong.size(); ++i) {
    Camera camera = site_.camera;
    wrong[i](camera);
    EXPECT_EQ(localizer.Localize(image(), {.camera = &camera}).status().code(),
              StatusCode::kInvalidArgument)
        << i;
  }
  ExpectPose(localizer.Localize(image()), 0.005, 0.002);
}

TEST_F(LocalizerPoseTest, APriorPoseThatIsNoneIsAnError) {
  Localizer localizer = Make();
  const Rigid3 truth = Inverse(site_.world_from_cam);
  for (const double value : {kNan, 1 / 0.0, 1e200}) {
    Rigid3 broken = truth;
    broken.translation.y() = value;
    EXPECT_EQ(localizer.Localize(image(), {.cam_from_world = &broken}).status().code(),
              StatusCode::kInvalidArgument)
        << value;
    broken = truth;
    broken.rotation.x() = value;
    EXPECT_EQ(localizer.Localize(image(), {.cam_from_world = &broken}).status().code(),
              StatusCode::kInvalidArgument)
        << value;
  }
}

TEST_F(LocalizerPoseTest, APredictedPoseIsTriedFirst) {
  Localizer localizer = Make();
  Rigid3 predicted = Inverse(site_.world_from_cam);
  predicted.translation += Eigen::Vector3d(0.05, -0.03, 0.02);
  const auto fix = localizer.Localize(image(), {.cam_from_world = &predicted});
  ExpectPose(fix, 0.005, 0.002);
  EXPECT_THAT(localizer.pair_scores(), testing::Each(0.0F)) << "it was scored all the same";
}

TEST_F(LocalizerPoseTest, AWrongPredictionFallsBackToTheWholeSearch) {
  Localizer localizer = Make();
  Rigid3 wrong = Inverse(site_.world_from_cam);
  wrong.translation += Eigen::Vector3d(5, 5, 5);
  const Rigid3 right = Inverse(site_.world_from_cam);
  ExpectPose(localizer.Localize(image(), {.cam_from_world = &wrong}), 0.005, 0.002);
  ExpectPose(localizer.Localize(image(), {.cam_from_world = &right, .map_idx = 5}), 0.005, 0.002);
  EXPECT_THAT(localizer.pair_scores(), testing::Not(testing::Each(0.0F)));
}

// The scores name a place whose landmarks are not in the frame: no answer.
TEST_F(LocalizerPoseTest, WithoutAgreeingLandmarksItDoesNotKnow) {
  for (auto& d : site_.data.landmark_descriptors) d = static_cast<std::int8_t>(-d);
  AllKeyframesSeeAll();
  Localizer localizer = Make();
  const auto fix = localizer.Localize(image());
  ASSERT_TRUE(fix.ok());
  EXPECT_FALSE(fix->localized);
  EXPECT_FALSE(fix->has_pose);
  EXPECT_TRUE(fix->reasons & kLowInliers);
  EXPECT_LT(fix->confidence, 0.9F);
  EXPECT_GE(fix->location_idx, 0) << "the best guess stays for those who measure";
}

// Where the best pair's keyframes see no landmarks, the scores' word stands.
TEST_F(LocalizerPoseTest, APlaceWithoutLandmarksIsStillNamed) {
  for (auto& d : site_.data.landmark_descriptors) d = static_cast<std::int8_t>(-d);
  site_.data.bias = {0, 0, 100, 0};  // whose nearest keyframe may be 4 or 5
  LeaveOutTheSecondLocation();
  Localizer localizer = Make();
  const auto fix = localizer.Localize(image());
  ASSERT_TRUE(fix.ok());
  EXPECT_TRUE(fix->localized);
  EXPECT_FALSE(fix->has_pose);
  EXPECT_EQ(fix->location_idx, 1);
}

// But where half of its keyframes see some, a frame that agrees with none is not of that place: not
// even if the keyframe most like it happens to see none.
TEST_F(LocalizerPoseTest, AMappedPlaceIsNotNamedByScoresAlone) {
  for (auto& d : site_.data.landmark_descriptors) d = static_cast<std::int8_t>(-d);
  site_.data.bias = {0, 0, 100, 0};
  AllKeyframesSeeAll();
  Localizer whole = Make();
  const int nearest = whole.Localize(image())->keyframe_idx;
  AllKeyframesSeeAll(nearest);
  Localizer localizer = Make();
  const auto fix = localizer.Localize(image());
  ASSERT_TRUE(fix.ok());
  EXPECT_EQ(fix->keyframe_idx, nearest);
  EXPECT_EQ(fix->location_idx, 1);
  EXPECT_FALSE(fix->localized);
  EXPECT_TRUE(fix->reasons & kLowInliers);
}

// A pose that little speaks for is believed if the model's curve says that such ones are right.
TEST_F(LocalizerPoseTest, OfPosesThatLittleSpeaksForTheCurveDecides) {
  Localizer usual = Make();
  const Fix clear = *usual.Localize(image());
  ASSERT_GT(clear.num_inliers, 80);
  const double rarity = 5.0 / clear.num_inliers;  // of each: five in all
  site_.data.landmark_rarity.assign(site_.data.landmark_rarity.size(),
                                    static_cast<std::uint8_t>(255 * rarity));
  Localizer without = Make();
  const auto doubted = without.Localize(image());
  ASSERT_TRUE(doubted.ok());
  EXPECT_FALSE(doubted->localized);
  EXPECT_FALSE(doubted->has_pose);
  EXPECT_EQ(doubted->reasons, kLowInliers);
  EXPECT_GT(doubted->evidence, 3);
  EXPECT_LT(doubted->evidence, 10);
  site_.data.pose_confidence = ModelPoseConfidence{2, {}, 0.5F};
  Localizer trusting = Make();
  ExpectPose(trusting.Localize(image()), 0.005, 0.002);
  site_.data.pose_confidence = ModelPoseConfidence{-2, {}, 0.5F};
  Localizer doubting = Make();
  EXPECT_FALSE(doubting.Localize(image())->localized);
}

// A pose elsewhere that is not believed has no say where the scores name a place without landmarks.
TEST_F(LocalizerPoseTest, APoseThatIsNotBelievedLeavesAnUnmappedPlaceToTheScores) {
  site_.data.bias = {0, 0, 100, 0};
  LeaveOutTheSecondLocation();
  site_.data.pose_confidence = ModelPoseConfidence{2, {}, 0.5F};
  Localizer trusting = Make();
  EXPECT_EQ(trusting.Localize(image())->location_idx, 0) << "else this shows nothing";
  site_.data.pose_confidence = ModelPoseConfidence{-2, {}, 0.5F};
  Localizer doubting = Make();
  const auto fix = doubting.Localize(image());
  ASSERT_TRUE(fix.ok());
  EXPECT_TRUE(fix->localized);
  EXPECT_FALSE(fix->has_pose);
  EXPECT_EQ(fix->location_idx, 1);
}

// What the scores name and what the landmarks say differ: the landmarks decide, and the rivals
// are other places than the one they name.
TEST_F(LocalizerPoseTest, LandmarksOverruleTheScores) {
  site_.data.weight_scale.assign(4, 1e-9F);
  site_.data.bias = {0, 0, 0.1F, 0.1F};  // the second location, just
  LeaveOutTheSecondLocation();
  Localizer localizer = Make();
  const auto fix = localizer.Localize(image());
  ExpectPose(fix, 0.005, 0.002);
  EXPECT_EQ(fix->location_idx, 0);
  EXPECT_EQ(fix->score, localizer.pair_scores()[fix->pair_idx]);
}

// The same landmarks in two maps, the second one seen by the second location's keyframes.
class LookAlikesTest : public LocalizerPoseTest {
 protected:
  LookAlikesTest() {
    ModelData& data = site_.data;
    const std::uint32_t size = data.map_begin[1];
    const auto twice = [](auto& v) {
      const auto once = v;
      v.insert(v.end(), once.begin(), once.end());
    };
    twice(data.landmark_position);
    twice(data.landmark_descriptors);
    twice(data.landmark_laplacian_sign);
    twice(data.landmark_rarity);
    data.map_begin = {0, size, 2 * size};
    twice(data.map_origin);
    twice(data.map_step);
    // Keyframes 0 and 2 are of the first location, 4 and 6 of the second.
    for (std::size_t i = data.keyframe_landmark_begin[4]; i < data.keyframe_landmarks.size(); ++i) {
      data.keyframe_landmarks[i] += size;
    }
    data.weight_scale.assign(4, 1e-9F);
  }
};

// Either is as good, and neither is said.
TEST_F(LookAlikesTest, OfTwoFloorsAreAmbiguous) {
  site_.data.locations = {"floor1/lobby", "floor2/lobby"};
  Localizer localizer = Make();
  const auto fix = localizer.Localize(image());
  ASSERT_TRUE(fix.ok());
  EXPECT_FALSE(fix->localized);
  EXPECT_FALSE(fix->has_pose);
  EXPECT_EQ(fix->reasons, kAmbiguous);
  EXPECT_LE(fix->confidence, 0.5F);
  ASSERT_EQ(fix->num_rivals, 1);
  EXPECT_EQ(fix->rivals[0], 1 - fix->location_idx);
  EXPECT_TRUE(fix->GuessIsRival());
}

TEST_F(LookAlikesTest, OfOneFloorSayTheFloor) {
  Localizer localizer = Make();
  const auto fix = localizer.Localize(image());
  ASSERT_TRUE(fix.ok());
  EXPECT_TRUE(fix->localized);
  EXPECT_EQ(fix->level, 1);
  EXPECT_FALSE(fix->has_pose);
  EXPECT_EQ(fix->reasons, kAmbiguous);
  EXPECT_GT(fix->confidence, 0.9F) << "of the floor";
  ASSERT_EQ(fix->num_rivals, 1);
  EXPECT_EQ(fix->rivals[0], 1 - fix->location_idx);
}

// Nor the floor, of poses that would not be believed if each were alone.
TEST_F(LookAlikesTest, ThatAreNotBelievedSayNothing) {
  site_.data.pose_confidence = ModelPoseConfidence{-2, {}, 0.5F};
  Localizer localizer = Make();
  const auto fix = localizer.Localize(image());
  ASSERT_TRUE(fix.ok());
  EXPECT_FALSE(fix->localized);
  EXPECT_EQ(fix->level, 0);
  EXPECT_EQ(fix->reasons, kAmbiguous);
  EXPECT_LE(fix->confidence, 0.5F);
  EXPECT_EQ(fix->num_rivals, 1);
}

// A corridor whose ends look alike: the corridor it is, but not at which end.
TEST_F(LookAlikesTest, OfOneLocationSayTheLocation) {
  site_.data.locations = {"floor1/corridor"};
  site_.data.views = {"a", "b", "c", "d"};
  site_.data.pair_location = {0, 0, 0, 0};
  site_.data.pair_view = {0, 1, 2, 3};
  Localizer localizer = Make();
  const auto fix = localizer.Localize(image());
  ASSERT_TRUE(fix.ok());
  EXPECT_TRUE(fix->localized);
  EXPECT_EQ(fix->level, 2);
  EXPECT_FALSE(fix->has_pose);
  EXPECT_EQ(fix->reasons, kAmbiguous);
  EXPECT_EQ(fix->num_rivals, 0);
  EXPECT_FALSE(fix->GuessIsRival());
}

TEST_F(LocalizerPoseTest, AModelCameraThatIsNoneIsRefused) {
  site_.data.camera.model = 1;
  site_.data.camera.intrinsics[2] = 1e308;
  site_.data.camera.intrinsics[3] = 1e308;  // finite, but their sum
  const auto file = WriteModel(site_.data);
  ASSERT_TRUE(file.ok());
  EXPECT_FALSE(Localizer::Create(*ModelView::Open(*file), {}).ok());
}

// Scores so large that they overflow name no place, and end.
TEST_F(LocalizerPoseTest, ScoresThatOverflowEnd) {
  site_.data.weight_scale = {3e38F, -3e38F, 3e38F, -3e38F};
  Localizer localizer = Make();
  EXPECT_TRUE(localizer.Localize(image()).ok());
}

TEST_F(LocalizerPoseTest, FramesDoNotInfluenceEachOther) {
  Localizer localizer = Make();
  const Fix alone = *localizer.Localize(image());
  (void)localizer.Localize(strip());
  const Fix again = *localizer.Localize(image());
  EXPECT_EQ(again.world_from_cam.translation, alone.world_from_cam.translation);
  EXPECT_EQ(again.covariance, alone.covariance);
  EXPECT_EQ(again.num_inliers, alone.num_inliers);
}

TEST_F(LocalizerPoseTest, WindowsOutOfRangeAreRefused) {
  file_ = *WriteModel(site_.data);
  model_ = *ModelView::Open(file_);
  for (const int window : {-1, 2, 9, 1 << 30}) {
    LocalizerOptions options;
    options.window = window;
    EXPECT_FALSE(Localizer::Create(model_, options).ok()) << window;
  }
  for (const double interval : {0.0, -1.0, kNan}) {
    LocalizerOptions options;
    options.window = 4;
    options.frame_interval_s = interval;
    EXPECT_FALSE(Localizer::Create(model_, options).ok()) << interval;
  }
}

}  // namespace
}  // namespace viewfix
