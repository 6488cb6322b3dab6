// SPDX-License-Identifier: BSD-3-Clause
// The figures of answers that are made up.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "firmware_tools/evaluation/evaluate.h"

namespace viewfix {
namespace {

class FiguresTest : public testing::Test {
 protected:
  // An image of `truth` and the answer to it: `level` parts of `answer`, 0: none.
  void Add(const std::string& truth, const std::string& answer, int level, float confidence) {
    ImageRecord image;
    image.location = truth;
    image.is_test = true;
    FrameResult result;
    result.image_idx = static_cast<int>(set_.images.size());
    result.location = answer;
    result.fix.localized = level > 0;
    result.fix.level = level == 2 ? 0 : level;
    result.fix.confidence = confidence;
    set_.images.push_back(image);
    evaluation_.frames.push_back(result);
  }
  nlohmann::ordered_json Figures() { return FiguresAsJson(set_, evaluation_, nullptr); }

  ImageSet set_;
  Evaluation evaluation_;
};

TEST_F(FiguresTest, AFloorIsAnAnswerAtItsLevelAlone) {
  Add("f1/hall", "f1/hall", 2, 0.9F);
  Add("f1/hall", "f1/lobby", 1, 0.8F);  // the floor is right
  Add("f1/hall", "f2/hall", 1, 0.7F);   // it is not
  Add("f1/hall", "f1/hall", 0, 0.4F);
  const auto figures = Figures();
  const auto& refusal = figures["refusal"];
  EXPECT_EQ(refusal["answered"], 0.75);
  EXPECT_EQ(refusal["answered_by_level"], nlohmann::json({0.75, 0.25}));
  EXPECT_DOUBLE_EQ(refusal["wrong_of_answered"], 1.0 / 3);
  EXPECT_EQ(figures["location"]["accuracy"], 0.5) << "of the best guesses, answered or not";
  EXPECT_EQ(figures["frames"][0]["level"], 2);
  EXPECT_EQ(figures["frames"][1]["level"], 1);
  EXPECT_EQ(figures["frames"][3]["level"], 0);
}

TEST_F(FiguresTest, DiagramsHaveTheirPoints) {
  Add("f1/hall", "f1/hall", 2, 0.9F);
  Add("f1/hall", "f2/hall", 2, 0.5F);
  const auto confidence = Figures()["confidence"];
  ASSERT_EQ(confidence["reliability"].size(), 2U);
  EXPECT_EQ(confidence["reliability"][0]["right"], 0);
  EXPECT_EQ(confidence["reliability"][1]["right"], 1);
  EXPECT_EQ(confidence["reliability"][1]["images"], 1);
  EXPECT_EQ(confidence["reliability"][1]["right_ci95"].size(), 2U);
  ASSERT_EQ(confidence["risk_coverage"].size(), 2U);
  EXPECT_EQ(confidence["risk_coverage"][0]["coverage"], 0.5);
  EXPECT_EQ(confidence["risk_coverage"][0]["risk"], 0);
  EXPECT_EQ(confidence["risk_coverage"][1]["risk"], 0.5);
  evaluation_.frames.clear();
  EXPECT_TRUE(Figures()["confidence"]["reliability"].empty());
}

TEST_F(FiguresTest, LocationsConfusionAndFailuresAreCounted) {
  Add("f1/hall", "f1/hall", 2, 0.9F);
  Add("f1/hall", "f2/hall", 2, 0.6F);  // answered, wrong
  Add("f1/hall", "f2/hall", 2, 0.8F);  // the same, surer
  Add("f2/hall", "", 0, 0.1F);         // no guess
  Add("f2/hall", "f1/hall", 0, 0.3F);  // not answered
  Add("", "f1/hall", 2, 0.9F);         // nobody knows
  const auto figures = Figures();
  EXPECT_EQ(figures["locations"][0],
            nlohmann::ordered_json::parse(
                R"({"location": "f1/hall", "images": 3, "right": 1, "answered": 3, "wrong": 2})"));
  EXPECT_EQ(figures["locations"][1],
            nlohmann::ordered_json::parse(
                R"({"location": "f2/hall", "images": 2, "right": 0, "answered": 0, "wrong": 0})"));
  EXPECT_EQ(figures["confusion"], nlohmann::ordered_json::parse(R"([
      {"true": "f1/hall", "guess": "f1/hall", "images": 1},
      {"true": "f1/hall", "guess": "f2/hall", "images": 2},
      {"true": "f2/hall", "guess": null, "images": 1},
      {"true": "f2/hall", "guess": "f1/hall", "images": 1}])"));
  EXPECT_EQ(figures["failures"], nlohmann::json({2, 1, 4, 3})) << "answers first, surest first";
  EXPECT_EQ(figures["frames"][2]["wrong"], true);
}

TEST_F(FiguresTest, ReasonsAreNamed) {
  Add("f1/hall", "f1/hall", 0, 0.4F);
  evaluation_.frames[0].fix.reasons = kBlurred | kLowInliers;
  EXPECT_EQ(Figures()["frames"][0]["reasons"], nlohmann::json({"blurred", "low_inliers"}));
}

}  // namespace
}  // namespace viewfix
