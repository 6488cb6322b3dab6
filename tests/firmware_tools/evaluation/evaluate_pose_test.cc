// SPDX-License-Identifier: BSD-3-Clause
// What `eval` says of poses.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "firmware_tools/evaluation/evaluate.h"
#include "tests/testing/jpeg_encoder.h"
#include "tests/testing/landmark_site.h"
#include "tests/testing/temp_folder.h"

namespace viewfix {
namespace {

// The map's scale, turn and shift against the set's world.
const double kScale = 2;
const Eigen::Quaterniond kTurn = Eigen::Quaterniond(0.8, 0.1, 0.5, -0.2).normalized();
const Eigen::Vector3d kShift(10, -20, 3);

Pose InWorld(const Rigid3& map_from_cam) {
  return {kTurn * map_from_cam.rotation, kScale * (kTurn * map_from_cam.translation) + kShift};
}

class EvaluatePoseTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_.Write("seen.jpg", EncodeJpeg(site_.pixels, site_.width, site_.height, 1));
    const std::vector<std::uint8_t> grey(site_.pixels.size(), 128);
    folder_.Write("plain.jpg", EncodeJpeg(grey, site_.width, site_.height, 1));
    set_.folder = set_.source = folder_.path();
    site_.data.metric = false;
    for (std::size_t k = 0; k < site_.data.keyframe_pair.size(); ++k) AddKeyframe(k);
    AddTest("seen.jpg");
    AddTest("plain.jpg");
  }

  // Places that lie on no line.
  void AddKeyframe(std::size_t k) {
    std::string name = "train0.jpg";
    name[5] = static_cast<char>('0' + k);
    site_.data.keyframe_names.push_back(name);
    const float x = static_cast<float>(k);
    if (k % 2 == 0) site_.data.keyframe_pose[k] = {x, 0.1F * x * x, 1, 0, 0, 0, 1};
    ImageRecord image;
    image.path = name;
    image.pose = InWorld({Eigen::Quaterniond::Identity(), Eigen::Vector3d(x, 0.1 * x * x, 1)});
    set_.images.push_back(image);
  }

  void AddTest(const std::string& path) {
    ImageRecord image;
    image.path = path;
    image.location = site_.data.locations[0];
    image.is_test = true;
    image.pose = InWorld(site_.world_from_cam);
    set_.images.push_back(image);
  }

  nlohmann::ordered_json PoseFigures() {
    const auto file = *WriteModel(site_.data);
    evaluation_ = Evaluate(set_, *ModelView::Open(file), {}, {});
    return FiguresAsJson(set_, evaluation_, nullptr)["pose"];
  }

  LandmarkSite site_ = MakeLandmarkSite();
  TempFolder folder_;
  ImageSet set_;
  Evaluation evaluation_;
};

TEST_F(EvaluatePoseTest, AFreeScaleMapIsLaidOverTheTrainingPoses) {
  const auto pose = PoseFigures();
  EXPECT_EQ(pose["labelled"], 2);
  EXPECT_EQ(pose["localized"], 0.5);
  EXPECT_EQ(pose["alignment"]["training_images"], 4);
  EXPECT_LT(pose["alignment"]["rmse_m"].get<double>(), 1e-5);
  EXPECT_LT(pose["alignment"]["median_m"].get<double>(), 1e-5);
  ASSERT_EQ(evaluation_.frames.size(), 2U);
  ASSERT_TRUE(evaluation_.frames[0].translation_error);
  EXPECT_LT(*evaluation_.frames[0].translation_error, 0.02);
  EXPECT_LT(*evaluation_.frames[0].rotation_error_deg, 0.3);
  EXPECT_FALSE(evaluation_.frames[1].translation_error) << "a plain image is nowhere";
  for (const char* at :
       {"0.05m_2deg", "0.05m_5deg", "0.1m_5deg", "0.25m_2deg", "0.5m_5deg", "5m_10deg"}) {
    EXPECT_EQ(pose["recall"][at], 0.5) << at;
  }
}

TEST_F(EvaluatePoseTest, AFrameThatIsNotLocalizedIsInfinitelyFar) {
  set_.images.erase(set_.images.end() - 2);  // the plain image stays
  const auto pose = PoseFigures();
  EXPECT_EQ(pose["localized"], 0);
  EXPECT_TRUE(pose["median_translation_m"].is_null());
  EXPECT_EQ(pose["recall"]["5m_10deg"], 0);
}

// The test images' own poses must not help.
TEST_F(EvaluatePoseTest, AlignmentIsByTrainingPosesOnly) {
  set_.images[set_.images.size() - 2].pose->cam_in_world.x() += 7;
  (void)PoseFigures();
  EXPECT_NEAR(*evaluation_.frames[0].translation_error, 7, 0.05);
}

TEST_F(EvaluatePoseTest, WithoutTrainingPosesNothingIsCompared) {
  for (ImageRecord& image : set_.images) {
    if (!image.is_test) image.pose.reset();
  }
  const auto pose = PoseFigures();
  EXPECT_EQ(pose["localized"], 0);
  EXPECT_FALSE(pose.contains("alignment"));
}

TEST_F(EvaluatePoseTest, AMetricMapIsTakenAtItsWord) {
  site_.data.metric = true;
  const Rigid3& truth = site_.world_from_cam;
  set_.images[set_.images.size() - 2].pose = Pose{truth.rotation, truth.translation};
  const auto pose = PoseFigures();
  EXPECT_FALSE(pose.contains("alignment"));
  EXPECT_LT(*evaluation_.frames[0].translation_error, 0.01);
}

// A smaller map has a frame of reference of its own.
TEST_F(EvaluatePoseTest, OnlyTheLargestMapIsCompared) {
  ModelData& data = site_.data;
  data.map_begin = {0, 0, data.map_begin[1]};
  data.map_origin.push_back(data.map_origin[0]);
  data.map_step.push_back(data.map_step[0]);
  const auto pose = PoseFigures();
  EXPECT_TRUE(evaluation_.frames[0].fix.has_pose);
  EXPECT_EQ(evaluation_.frames[0].fix.map_idx, 1);
  EXPECT_EQ(pose["localized"], 0);
}

// Unless control points brought both to the site's.
TEST_F(EvaluatePoseTest, MetricMapsShareTheirFrame) {
  ModelData& data = site_.data;
  data.metric = true;
  data.map_begin = {0, 0, data.map_begin[1]};
  data.map_origin.push_back(data.map_origin[0]);
  data.map_step.push_back(data.map_step[0]);
  data.map_metric = {1, 0};
  EXPECT_EQ(PoseFigures()["localized"], 0);
  data.map_metric = {1, 1};
  const Rigid3& truth = site_.world_from_cam;
  set_.images[set_.images.size() - 2].pose = Pose{truth.rotation, truth.translation};
  EXPECT_EQ(PoseFigures()["localized"], 0.5);
  EXPECT_LT(*evaluation_.frames[0].translation_error, 0.01);
}

}  // namespace
}  // namespace viewfix
