// SPDX-License-Identifier: BSD-3-Clause
#include "tests/bench/feature_study.h"

#include <gtest/gtest.h>

#include <map>
#include <string>

namespace viewfix {
namespace {

std::map<std::string, StudyScore> MeanScores(const StudyMethod& method,
                                             const std::vector<StudyChange>& changes) {
  std::map<std::string, StudyScore> means;
  std::map<std::string, int> counts;
  for (const StudyChange& change : changes) ++counts[change.category];
  for (const StudyChange& change : changes) {
    const StudyScore score = Score(method, change, 150);
    means[change.category].repeated += score.repeated / counts[change.category];
    means[change.category].matched += score.matched / counts[change.category];
  }
  return means;
}

// One small image: loose bounds. feature_repeatability gives the figures.
TEST(FeatureStudy, SurfIsAboutAsRepeatableAsDlibs) {
  const std::vector<StudyChange> changes = MakeChanges(RenderStudyImage(400, 300, 1));
  const auto ours = MeanScores(*MakeViewfixSurf(false), changes);
  const auto theirs = MeanScores(*MakeDlibSurf(2), changes);
  for (const std::string category : {"rotation", "scale", "blur", "light", "jpeg"}) {
    EXPECT_GT(ours.at(category).repeated, theirs.at(category).repeated - 0.05) << category;
    EXPECT_GT(ours.at(category).matched, theirs.at(category).matched - 0.05) << category;
    EXPECT_GT(ours.at(category).repeated, 0.3) << category;
  }
}

TEST(FeatureStudy, OnlyOrientationSurvivesRolling) {
  std::vector<StudyChange> rolls;
  for (StudyChange& change : MakeChanges(RenderStudyImage(400, 300, 2))) {
    if (change.category == "rotation" && change.name != "5 deg") rolls.push_back(change);
  }
  const double oriented = MeanScores(*MakeViewfixSurf(false), rolls).at("rotation").matched;
  const double upright = MeanScores(*MakeViewfixSurf(true), rolls).at("rotation").matched;
  EXPECT_GT(oriented, upright + 0.2);
}

}  // namespace
}  // namespace viewfix
