// SPDX-License-Identifier: BSD-3-Clause
// A model made upon another one: what did not change is the base's to the bit.
#include "firmware_tools/training/base_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <set>

#include "firmware_tools/dataset/image_set.h"
#include "models/huffman_decoder.h"
#include "tests/testing/tiny_model.h"

namespace viewfix {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr int kChanged = 0;  // of the two locations; four keyframes each
constexpr int kKept = 1;

ModelData NamedModel() {
  ModelData data = TinyModelData();
  for (int k = 0; k < 8; ++k) data.keyframe_names.push_back("image" + std::to_string(k));
  return data;
}

BaseModel BaseOfOneMap() {
  BaseModel base{NamedModel(), "id"};
  AddTinyMaps(base.data);
  base.data.map_begin = {0, 40};
  base.data.map_origin.resize(1);
  base.data.map_step.resize(1);
  base.data.map_metric.resize(1);
  return base;
}

// Trained again, with one photograph of the first location replaced, everything came out different.
ModelData TrainedAgain(const ModelData& base) {
  ModelData model = base;
  model.keyframe_names[1] = "another";
  for (std::int8_t& weight : model.weights) weight = static_cast<std::int8_t>(-weight);
  for (float& bias : model.bias) bias += 1;
  return model;
}

// Of one keyframe: the descriptors that it sees, with their chroma, whatever their landmarks'
// numbers.
std::multiset<std::vector<std::int8_t>> SeenBy(const ModelData& data, int keyframe) {
  const int dim = data.features.descriptor_dim;
  std::multiset<std::vector<std::int8_t>> seen;
  for (std::uint32_t i = data.keyframe_landmark_begin[keyframe];
       i < data.keyframe_landmark_begin[keyframe + 1]; ++i) {
    const auto begin = data.landmark_descriptors.begin() + data.keyframe_landmarks[i] * dim;
    std::vector<std::int8_t> row(begin, begin + dim);
    if (!data.landmark_chroma.empty()) {
      const auto chroma =
          data.landmark_chroma.begin() + data.keyframe_landmarks[i] * kLandmarkChromaDim;
      row.insert(row.end(), chroma, chroma + kLandmarkChromaDim);
    }
    seen.insert(row);
  }
  return seen;
}

TEST(BaseModelTest, ASetThatDidNotChangeGivesTheSameBytes) {
  BaseModel base{NamedModel(), "id"};
  AddTinyMaps(base.data);
  AddTinyDetails(base.data);
  const std::size_t landmarks = base.data.landmark_position.size();
  for (std::size_t i = 0; i < landmarks * kLandmarkChromaDim; ++i) {
    base.data.landmark_chroma.push_back(static_cast<std::int8_t>(i % 33));
  }
  ModelData model = base.data;
  for (float& bias : model.bias) bias += 1;
  const BaseReport report = KeepUnchanged(base, true, model);
  EXPECT_EQ(report.kept.size(), 2U);
  EXPECT_THAT(report.trained, IsEmpty());
  EXPECT_EQ(*WriteModel(model), *WriteModel(base.data));
}

TEST(BaseModelTest, OnlyTheChangedLocationsWeightsAreNew) {
  const BaseModel base{NamedModel(), "id"};
  const ModelData trained = TrainedAgain(base.data);
  ModelData model = trained;
  const BaseReport report = KeepUnchanged(base, true, model);
  EXPECT_THAT(report.kept, ElementsAre(base.data.locations[kKept]));
  EXPECT_THAT(report.trained, ElementsAre(base.data.locations[kChanged]));
  for (std::size_t i = 0; i < model.weights.size(); ++i) {
    const bool kept = base.data.pair_location[i % 4] == kKept;
    EXPECT_EQ(model.weights[i], (kept ? base.data : trained).weights[i]) << i;
  }
  EXPECT_EQ(model.bias[0], trained.bias[0]);
  EXPECT_EQ(model.bias[3], base.data.bias[3]);
}

// So that rows which have not changed keep their bytes.
TEST(BaseModelTest, CodeTablesAreTheBases) {
  BaseModel base{NamedModel(), "id"};
  base.data.code_tables.keyframe_words = std::vector<std::uint8_t>(kCodeTableBytes, 0x88);
  ModelData model = TrainedAgain(base.data);
  model.code_tables = {};
  KeepUnchanged(base, true, model);
  const auto file = WriteModel(model);
  ASSERT_TRUE(file.ok()) << file.status().text();
  EXPECT_EQ(UnpackModel(*ModelView::Open(*file)).code_tables.keyframe_words,
            base.data.code_tables.keyframe_words);
}

TEST(BaseModelTest, APoseThatWasGivenAnewIsAChange) {
  const BaseModel base{NamedModel(), "id"};
  ModelData model = base.data;
  model.keyframe_pose[0][0] += 0.5F;
  ModelData from_photographs = model;
  EXPECT_THAT(KeepUnchanged(base, true, model).trained, ElementsAre(base.data.locations[kChanged]));
  EXPECT_THAT(KeepUnchanged(base, false, from_photographs).trained, IsEmpty())
      << "poses that come from the map come out anew each time";
}

TEST(BaseModelTest, LocationsComeAndGo) {
  BaseModel base{NamedModel(), "id"};
  base.data.locations = {"floor1/bar", "floor1/lobby"};
  ModelData model = base.data;
  model.locations = {"floor1/lobby", "floor1/shop"};
  // The lobby's photographs stand first now.
  std::rotate(model.keyframe_names.begin(), model.keyframe_names.begin() + 4,
              model.keyframe_names.end());
  const BaseReport report = KeepUnchanged(base, true, model);
  EXPECT_THAT(report.removed, ElementsAre("floor1/bar"));
  EXPECT_THAT(report.trained, ElementsAre("floor1/lobby", "floor1/shop"))
      << "the words are those of other photographs";
}

TEST(BaseModelTest, KeptKeyframesSeeTheBasesLandmarks) {
  BaseModel base{NamedModel(), "id"};
  AddTinyMaps(base.data);
  ModelData model = TrainedAgain(base.data);
  for (std::int8_t& value : model.landmark_descriptors) value = static_cast<std::int8_t>(-value);
  base.data.landmark_chroma.assign(base.data.landmark_position.size() * kLandmarkChromaDim, 3);
  model.landmark_chroma.assign(model.landmark_position.size() * kLandmarkChromaDim, -5);
  const ModelData trained = model;
  EXPECT_FALSE(KeepUnchanged(base, true, model).frame_grew);
  ASSERT_TRUE(WriteModel(model).ok()) << WriteModel(model).status().text();
  for (const int k : {0, 2}) EXPECT_EQ(SeenBy(model, k), SeenBy(trained, k));
  for (const int k : {4, 6}) EXPECT_EQ(SeenBy(model, k), SeenBy(base.data, k));
  EXPECT_EQ(model.map_origin, base.data.map_origin);
  EXPECT_EQ(model.map_step, base.data.map_step);
}

TEST(BaseModelTest, HolesAreFilledFromTheEnd) {
  BaseModel base{NamedModel(), "id"};
  AddTinyMaps(base.data);
  ModelData model = TrainedAgain(base.data);
  // The changed location sees fewer landmarks than it did.
  model.keyframe_landmarks = {0, 1, 2};
  model.keyframe_landmark_begin = {0, 3, 3, 3, 3, 3, 3, 3, 3};
  KeepUnchanged(base, true, model);
  ASSERT_TRUE(WriteModel(model).ok()) << WriteModel(model).status().text();
  EXPECT_EQ(model.map_begin[1], 3U + 3U) << "three that nobody saw before either";
  for (const int k : {4, 6}) EXPECT_EQ(SeenBy(model, k), SeenBy(base.data, k));
}

TEST(BaseModelTest, AMapThatReachesFartherKeepsItsPlace) {
  BaseModel base{NamedModel(), "id"};
  AddTinyMaps(base.data);
  ModelData model = TrainedAgain(base.data);
  model.map_step[0] = 0.5F;  // all of it lies hundreds of metres off
  EXPECT_TRUE(KeepUnchanged(base, true, model).frame_grew);
  ASSERT_TRUE(WriteModel(model).ok());
  EXPECT_EQ(model.map_origin[0], base.data.map_origin[0]);
  EXPECT_GT(model.map_step[0], base.data.map_step[0]);
  EXPECT_EQ(model.map_step[1], base.data.map_step[1]) << "the other map is as it was";
}

// One new landmark of 80 is twice as far away as the base's frame reaches.
TEST(BaseModelTest, FewLandmarksBeyondAMapAreLeftOut) {
  const BaseModel base = BaseOfOneMap();
  ModelData model = TrainedAgain(base.data);
  const auto twice = [](auto& rows) {
    const auto once = rows;
    rows.insert(rows.end(), once.begin(), once.end());
  };
  twice(model.landmark_position);
  twice(model.landmark_descriptors);
  twice(model.landmark_laplacian_sign);
  twice(model.landmark_rarity);
  model.map_begin = {0, 80};
  model.keyframe_landmarks.resize(80);
  std::iota(model.keyframe_landmarks.begin(), model.keyframe_landmarks.end(), 0U);
  model.keyframe_landmark_begin = {0, 80, 80, 80, 80, 80, 80, 80, 80};
  model.map_step[0] *= 2;
  model.landmark_position[79] = {32767, 0, 0};
  EXPECT_FALSE(KeepUnchanged(base, true, model).frame_grew);
  ASSERT_TRUE(WriteModel(model).ok()) << WriteModel(model).status().text();
  EXPECT_EQ(model.map_step, base.data.map_step);
  EXPECT_EQ(SeenBy(model, 0).size(), 79U);
}

TEST(BaseModelTest, MapsFromPhotographsAreMovedToTheBases) {
  BaseModel base = BaseOfOneMap();
  // Where four photographs of the kept location stand is known, not on a line.
  for (const int k : {4, 5, 6, 7}) {
    base.data.keyframe_has_pose[k] = 1;
    base.data.keyframe_pose[k] = {
        static_cast<float>(k % 2), static_cast<float>(k / 6), 0, 0, 0, 0, 1};
  }
  base.data.keyframe_landmarks = {0, 1, 2, 3, 4};
  base.data.keyframe_landmark_begin = {0, 1, 1, 1, 1, 2, 3, 4, 5};
  ModelData model = TrainedAgain(base.data);
  for (auto& pose : model.keyframe_pose) {  // twice as large, and elsewhere
    for (int axis = 0; axis < 3; ++axis) pose[axis] = 2 * pose[axis] + 5;
  }
  for (float& coordinate : model.map_origin[0]) coordinate = 2 * coordinate + 5;
  model.map_step[0] *= 2;
  KeepUnchanged(base, false, model);
  ASSERT_TRUE(WriteModel(model).ok()) << WriteModel(model).status().text();
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(model.keyframe_pose[0][axis], base.data.keyframe_pose[0][axis], 1e-4);
    EXPECT_NEAR(model.landmark_position[0][axis], base.data.landmark_position[0][axis], 1);
  }
}

TEST(BaseModelTest, DetailsOfKeptLocationsStay) {
  BaseModel base{NamedModel(), "id"};
  AddTinyDetails(base.data);
  ModelData model = TrainedAgain(base.data);
  for (std::uint8_t& code : model.details.codes) code ^= 0xFF;
  model.details.likeness_weight = 4.5F;
  model.details.close_weight = 6;
  model.confidence = {.offset = -3, .slope = 1, .threshold = 0.75F};
  const ModelData trained = model;
  KeepUnchanged(base, true, model);
  ASSERT_TRUE(WriteModel(model).ok());
  // The weights and the curve that was fitted with them are of one training.
  EXPECT_EQ(model.details.likeness_weight, trained.details.likeness_weight);
  EXPECT_EQ(model.details.close_weight, trained.details.close_weight);
  EXPECT_EQ(model.confidence.offset, trained.confidence.offset);
  // As many of each of two locations, and common ones, which stay the base's.
  const std::size_t bytes = model.details.codes.size() / 3;
  for (std::size_t i = 0; i < model.details.codes.size(); ++i) {
    const bool kept = i / bytes == kKept || i / bytes == 2;
    EXPECT_EQ(model.details.codes[i], (kept ? base.data : trained).details.codes[i]) << i;
  }
}

TEST(BaseModelTest, AnotherCameraIsRefused) {
  BaseModel base{NamedModel(), "id"};
  AddTinyMaps(base.data);
  ModelData model = base.data;
  model.camera.intrinsics[0] += 1;
  EXPECT_THROW(KeepUnchanged(base, true, model), ToolError);
}

TEST(BaseModelTest, WhatIsNoModelIsRefused) {
  EXPECT_THROW(ReadBaseModel(std::vector<std::uint8_t>(100), "x.vfx"), ToolError);
}

}  // namespace
}  // namespace viewfix
