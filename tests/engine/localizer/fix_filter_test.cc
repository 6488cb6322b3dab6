// SPDX-License-Identifier: BSD-3-Clause
#include "engine/fix_filter.h"

#include <gtest/gtest.h>

#include "models/model_writer.h"
#include "tests/testing/tiny_model.h"

namespace viewfix {
namespace {

constexpr int kHall = 0;
constexpr int kLobby = 1;

class FixFilterTest : public testing::Test {
 protected:
  static std::vector<std::uint8_t> File(float threshold = 0.5F) {
    ModelData data = TinyModelData();
    data.confidence.threshold = threshold;
    AddTinyMaps(data);
    return *WriteModel(data);
  }
  static Fix At(int location, float confidence) {
    Fix fix;
    fix.localized = true;
    fix.location_idx = location;
    fix.pair_idx = 2 * location;
    fix.confidence = confidence;
    return fix;
  }
  static Fix PoseAt(int location, float confidence, double x, int map = 0) {
    Fix fix = At(location, confidence);
    fix.has_pose = true;
    fix.map_idx = map;
    fix.world_from_cam.translation.x() = x;
    return fix;
  }
  static Fix Floor(int location, float confidence) {
    Fix fix = At(location, confidence);
    fix.level = 1;
    return fix;
  }
  Fix Next(std::uint64_t sequence, Fix fix) {
    filter_.Apply(sequence, fix);
    return fix;
  }

  const std::vector<std::uint8_t> file_ = File();
  const ModelView model_ = *ModelView::Open(file_);
  FixFilter filter_{model_};
};

TEST_F(FixFilterTest, TheFirstFrameIsAsItIs) {
  const Fix fix = Next(5, At(kHall, 0.7F));
  EXPECT_TRUE(fix.localized);
  EXPECT_EQ(fix.confidence, 0.7F);
}

// p = 0.8 fades to 0.785 in a frame; 0.785 * 0.7 / (0.785 * 0.7 + 0.215 * 0.3) = 0.8949.
TEST_F(FixFilterTest, AgreementRaisesByBayesRule) {
  Next(0, At(kHall, 0.8F));
  EXPECT_NEAR(Next(1, At(kHall, 0.7F)).confidence, 0.8949, 1e-4);
  float before = 0.8949F;
  for (std::uint64_t i = 2; i < 40; ++i) {
    const float now = Next(i, At(kHall, 0.7F)).confidence;
    EXPECT_GE(now, 0.7F);
    EXPECT_LT(now, 1);
    if (i < 4) {
      EXPECT_GT(now, before);
    }
    before = now;
  }
}

// 0.215 * 0.9 / (0.215 * 0.9 + 0.785 * 0.1) = 0.7114: lowered, and still said.
TEST_F(FixFilterTest, ContradictionLowers) {
  Next(0, At(kHall, 0.8F));
  const Fix fix = Next(1, At(kLobby, 0.9F));
  EXPECT_NEAR(fix.confidence, 0.7114, 1e-4);
  EXPECT_TRUE(fix.localized);
  EXPECT_EQ(fix.reasons, 0U);
}

TEST_F(FixFilterTest, AContradictionThatIsNotBelievedIsWithheldUntilItIsRepeated) {
  for (std::uint64_t i = 0; i < 5; ++i) Next(i, At(kHall, 0.8F));
  const Fix doubted = Next(5, PoseAt(kLobby, 0.8F, 3));
  EXPECT_FALSE(doubted.localized);
  EXPECT_FALSE(doubted.has_pose);
  EXPECT_EQ(doubted.map_idx, -1);
  EXPECT_LT(doubted.confidence, 0.5F);
  EXPECT_EQ(doubted.reasons, std::uint32_t{kAmbiguous});
  ASSERT_EQ(doubted.num_rivals, 1);
  EXPECT_EQ(doubted.rivals[0], kHall);
  EXPECT_EQ(doubted.location_idx, kLobby) << "the best guess stays for those who measure";
  int frames = 1;
  while (!Next(5 + frames, At(kLobby, 0.8F)).localized) ++frames;
  EXPECT_LE(frames, 3);
}

TEST_F(FixFilterTest, AFrameWithoutAnAnswerGetsNone) {
  for (std::uint64_t i = 0; i < 5; ++i) Next(i, PoseAt(kHall, 0.9F, 0));
  Fix lost = At(kHall, 0.45F);
  lost.localized = false;
  lost.reasons = kLowInliers;
  const Fix fix = Next(5, lost);
  EXPECT_FALSE(fix.localized);
  EXPECT_FALSE(fix.has_pose);
  EXPECT_EQ(fix.confidence, 0.45F);
  EXPECT_EQ(fix.reasons, std::uint32_t{kLowInliers});
}

TEST_F(FixFilterTest, AfterAGapAndAfterASeekNothingIsKnown) {
  for (const std::uint64_t later : {5 + FixFilter::kMaxGap, std::uint64_t{4}, std::uint64_t{2}}) {
    FixFilter filter(model_);
    for (std::uint64_t i = 0; i < 5; ++i) {
      Fix fix = At(kHall, 0.9F);
      filter.Apply(i, fix);
    }
    Fix other = At(kLobby, 0.6F);
    filter.Apply(later, other);
    EXPECT_EQ(other.confidence, 0.6F) << later;
    EXPECT_TRUE(other.localized);
  }
}

TEST_F(FixFilterTest, WhatWasKnownFades) {
  float last = 1;
  for (std::uint64_t gap = 1; gap <= FixFilter::kMaxGap; ++gap) {
    FixFilter filter(model_);
    Fix first = At(kHall, 0.9F);
    filter.Apply(0, first);
    Fix later = At(kHall, 0.7F);
    filter.Apply(gap, later);
    EXPECT_LT(later.confidence, last);
    EXPECT_GT(later.confidence, 0.7F);
    last = later.confidence;
  }
}

// Through a door: another name, a step away.
TEST_F(FixFilterTest, PosesWithinReachAgreeWhateverTheirNames) {
  Next(0, PoseAt(kHall, 0.9F, 0));
  EXPECT_GT(Next(1, PoseAt(kLobby, 0.9F, 0.5)).confidence, 0.95F);
}

TEST_F(FixFilterTest, PosesOutOfReachContradictThoughTheNameBeTheSame) {
  Next(0, PoseAt(kHall, 0.9F, 0));
  EXPECT_LT(Next(1, PoseAt(kHall, 0.9F, 1.5)).confidence, 0.7F);
  Next(20, PoseAt(kHall, 0.9F, 0));
  EXPECT_GT(Next(22, PoseAt(kHall, 0.9F, 1.5)).confidence, 0.95F) << "two frames' way";
}

// The threshold of answers without a pose is on another curve than the confidence of poses.
TEST_F(FixFilterTest, PosesAreWithheldBelowOneHalfOthersBelowTheThreshold) {
  const std::vector<std::uint8_t> file = File(0.8F);
  const ModelView model = *ModelView::Open(file);
  for (const bool pose : {true, false}) {
    FixFilter filter(model);
    Fix before = PoseAt(kHall, 0.8F, 0), fix = pose ? PoseAt(kLobby, 0.9F, 50) : At(kLobby, 0.9F);
    filter.Apply(0, before);
    filter.Apply(1, fix);
    EXPECT_NEAR(fix.confidence, 0.7114, 1e-4);
    EXPECT_EQ(fix.localized, pose);
  }
}

// How long a unit is, is not known there (map 1 of the tiny model).
TEST_F(FixFilterTest, InAMapWithoutScaleNamesDecide) {
  Next(0, PoseAt(kHall, 0.9F, 0, 1));
  EXPECT_GT(Next(1, PoseAt(kHall, 0.9F, 50, 1)).confidence, 0.95F);
  EXPECT_LT(Next(2, PoseAt(kLobby, 0.9F, 50, 1)).confidence, 0.9F);
}

// Both locations of the tiny model are on one floor.
TEST_F(FixFilterTest, AFloorAgreesWithItsAreasAndSaysNothingOfThem) {
  Next(0, At(kHall, 0.8F));
  EXPECT_GT(Next(1, Floor(kLobby, 0.7F)).confidence, 0.85F);
  const float contradicted = Next(2, At(kLobby, 0.9F)).confidence;
  EXPECT_LT(contradicted, 0.9F) << "the hall was forgotten over the floor";
  FixFilter filter(model_);
  Fix floor = Floor(kHall, 0.95F);
  filter.Apply(0, floor);
  Fix area = At(kHall, 0.7F);
  filter.Apply(1, area);
  EXPECT_EQ(area.confidence, 0.7F) << "surer of the area because the floor was sure";
}

TEST_F(FixFilterTest, RivalsHaveRoom) {
  for (std::uint64_t i = 0; i < 5; ++i) Next(i, At(kHall, 0.9F));
  Fix full = At(kLobby, 0.6F);
  full.num_rivals = Fix::kMaxRivals;
  for (int i = 0; i < Fix::kMaxRivals; ++i) full.rivals[i] = 10 + i;
  const Fix doubted = Next(5, full);
  ASSERT_EQ(doubted.num_rivals, Fix::kMaxRivals);
  EXPECT_EQ(doubted.rivals[0], kHall);
  EXPECT_EQ(doubted.rivals[3], 12);
  Fix named = At(kLobby, 0.6F);
  named.num_rivals = 3;
  named.rivals[0] = 10;
  named.rivals[1] = kHall;
  named.rivals[2] = 11;
  const Fix again = Next(6, named);
  ASSERT_EQ(again.num_rivals, 3);
  EXPECT_EQ(again.rivals[0], kHall);
  EXPECT_EQ(again.rivals[1], 10);
  EXPECT_EQ(again.rivals[2], 11);
}

TEST_F(FixFilterTest, CertaintyIsNeverFinal) {
  for (std::uint64_t i = 0; i < 50; ++i) Next(i, At(kHall, 1));
  int frames = 0;
  while (!Next(50 + frames, At(kLobby, 1)).localized) ++frames;
  EXPECT_LE(frames, 1);
}

}  // namespace
}  // namespace viewfix
