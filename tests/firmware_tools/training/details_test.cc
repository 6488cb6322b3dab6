// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/details.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <vector>

#include "models/model_writer.h"

namespace viewfix {
namespace {

constexpr int kDim = 16;
constexpr int kLocations = 3;
constexpr int kImages = 6;  // of each location
constexpr int kFeatures = 40;

// Images whose features are those of their location, a little off.
class DetailsTest : public ::testing::Test {
 protected:
  DetailsTest() {
    store_.dim = kDim;
    const std::vector<std::int8_t> of_locations = Draw(kLocations * kFeatures, 70);
    for (int l = 0; l < kLocations; ++l) {
      for (int i = 0; i < kImages; ++i) {
        ImageFeatures image;
        image.keypoints.resize(kFeatures);
        const std::vector<std::int8_t> noise = Draw(kFeatures, 3);
        for (int b = 0; b < kFeatures * kDim; ++b) {
          const int value = of_locations[l * kFeatures * kDim + b] + noise[b];
          image.descriptors.push_back(static_cast<std::int8_t>(value));
        }
        image_idxs_.push_back(static_cast<int>(store_.images.size()));
        locations_.push_back(l);
        store_.images.push_back(image);
      }
    }
    words_ = Draw(4, 30);
  }

  std::vector<std::int8_t> Draw(int rows, int limit) {
    std::vector<std::int8_t> bytes(std::size_t(rows) * kDim);
    for (std::int8_t& byte : bytes) {
      byte = static_cast<std::int8_t>(static_cast<int>(random_() % (2 * limit + 1)) - limit);
    }
    return bytes;
  }

  TrainedDetails Train(const DetailOptions& options) const {
    const auto n = static_cast<Eigen::Index>(image_idxs_.size());
    const Eigen::MatrixXf similarities = Eigen::MatrixXf::Zero(n, n);
    return TrainDetails({store_, image_idxs_, locations_, kLocations, words_, 2, similarities},
                        options, {});
  }

  static std::size_t SizeOf(const TrainedDetails& details) {
    return std::accumulate(details.table.list_size.begin(), details.table.list_size.end(),
                           std::size_t{0});
  }
  // In a model.
  static std::size_t BytesOf(const TrainedDetails& details) {
    const auto& sizes = details.table.list_size;
    return details.table.codes.size() + DetailListBytes(sizes, sizes.size() / (kLocations + 1));
  }
  // Of all details, those that are no location's own.
  static int CommonOf(const TrainedDetails& details) {
    const auto& sizes = details.table.list_size;
    return std::accumulate(sizes.end() - std::ssize(sizes) / (kLocations + 1), sizes.end(), 0);
  }

  std::mt19937 random_{1};
  FeatureStore store_;
  std::vector<int> image_idxs_;
  std::vector<int> locations_;
  std::vector<std::int8_t> words_;
};

TEST_F(DetailsTest, HeldOutImagesAreFound) {
  const TrainedDetails details = Train({});
  ASSERT_EQ(details.held_out.size(), std::size_t{kLocations} * kImages);
  for (const Outcome& outcome : details.held_out) {
    EXPECT_TRUE(outcome.right);
    EXPECT_GT(outcome.margin, 1);
  }
  ASSERT_EQ(details.elsewhere.size(), details.held_out.size());
  for (std::size_t i = 0; i < details.elsewhere.size(); ++i) {  // where their own is hidden
    EXPECT_FALSE(details.elsewhere[i].right);
    EXPECT_LT(details.elsewhere[i].margin, details.held_out[i].margin / 2);
  }
}

// Of a frame whose location is hidden hardly a feature is close to a detail.
TEST_F(DetailsTest, CloseDetailsTellHiddenLocationsFromKnownOnes) {
  const TrainedDetails details = Train({.hidden_weight = 1});
  EXPECT_GT(details.table.close_weight, 0);
  const TrainedDetails without = Train({.hidden_weight = 0});
  const double weight = details.table.close_weight - without.table.close_weight;
  for (std::size_t i = 0; i < details.held_out.size(); ++i) {
    const double known = details.held_out[i].margin - without.held_out[i].margin;
    const double hidden = details.elsewhere[i].margin - without.elsewhere[i].margin;
    EXPECT_NEAR(known, weight * std::sqrt(kFeatures), weight);  // nearly all are
    EXPECT_LT(hidden, known / 2);
  }
}

// All held-out frames are right: hidden ones say what is too little.
TEST_F(DetailsTest, HiddenLocationsAreNotAnsweredWhereNoAnswerIsWrong) {
  const DetailOptions options;
  const TrainedDetails details = Train(options);
  const ModelConfidence confidence = FitDetailConfidence(details, options);
  EXPECT_EQ(AnsweredOf(details.held_out, confidence).share, 1);
  EXPECT_EQ(AnsweredOf(details.held_out, confidence).wrong, 0);
  EXPECT_LT(AnsweredOf(details.elsewhere, confidence).share, 0.1);
}

// Where enough answers are wrong these alone say how sure to be.
TEST_F(DetailsTest, HiddenLocationsDoNotBendTheConfidenceOfKnownOnes) {
  TrainedDetails details = Train({});
  for (std::size_t i = 0; i < details.held_out.size(); i += 4) details.held_out[i].right = false;
  const ModelConfidence confidence = FitDetailConfidence(details, {.wrong_share = 1});
  const ModelConfidence known = FitConfidence(details.held_out);
  EXPECT_FLOAT_EQ(confidence.offset, known.offset);
  EXPECT_FLOAT_EQ(confidence.slope, known.slope);
}

TEST_F(DetailsTest, FeaturesThatLookAlikeAreOneDetail) {
  const TrainedDetails details = Train({});
  EXPECT_LT(SizeOf(details), 2 * kLocations * kFeatures);
  const TrainedDetails all = Train({.merge_distance = 0});
  EXPECT_EQ(SizeOf(all), std::size_t{kLocations} * kImages * kFeatures);
}

TEST_F(DetailsTest, WhatManyLocationsHaveIsCommon) {
  EXPECT_EQ(CommonOf(Train({.common_locations = kLocations})), 0);
  for (std::size_t s = 1; s < store_.images.size(); ++s) {  // half of each image is everywhere
    std::copy_n(store_.images[0].descriptors.begin(), kFeatures / 2 * kDim,
                store_.images[s].descriptors.begin());
  }
  const TrainedDetails details = Train({.common_locations = kLocations});
  EXPECT_EQ(CommonOf(details), kFeatures / 2);
  for (const Outcome& outcome : details.held_out) EXPECT_TRUE(outcome.right);
}

TEST_F(DetailsTest, FitsItsRoom) {
  const std::size_t bytes = 1500;
  const TrainedDetails details = Train({.max_bytes = bytes, .merge_distance = 0});
  EXPECT_GT(SizeOf(details), 0U);
  EXPECT_LE(BytesOf(details), bytes);
  EXPECT_TRUE(Train({.max_bytes = 0}).table.codes.empty());
  EXPECT_TRUE(Train({.max_bytes = 10}).table.codes.empty());
}

TEST_F(DetailsTest, LeavesOutDirectionsWhereBytesDoNotDivideThem) {
  for (const int parts : {1, 6, 7, 16}) {
    const TrainedDetails details = Train({.parts = parts});
    const int turned_dim = kDim / parts * parts;
    EXPECT_EQ(details.table.rotation.size(), std::size_t(turned_dim) * kDim);
    EXPECT_EQ(details.table.codebook.size(), std::size_t{256} * turned_dim);
    EXPECT_EQ(details.table.codes.size(), SizeOf(details) * parts);
    EXPECT_TRUE(std::all_of(details.held_out.begin(), details.held_out.end(), [](const Outcome& o) {
      return o.right;
    })) << parts;
  }
  EXPECT_TRUE(Train({.parts = kDim + 1}).table.codes.empty());
}

TEST_F(DetailsTest, ShortensCodesRatherThanMergeFarther) {
  const auto room = [&](int parts) {  // for what is left if details are merged a little further
    return BytesOf(Train({.merge_distance = 5, .parts = parts}));
  };
  EXPECT_EQ(Train({.max_bytes = room(8), .merge_distance = 0}).table.parts, 8);
  EXPECT_EQ(Train({.max_bytes = room(8) - 1, .merge_distance = 0}).table.parts, 6);
  EXPECT_EQ(Train({.max_bytes = room(6) - 1, .merge_distance = 0}).table.parts, 5);
  EXPECT_EQ(Train({.max_bytes = room(5) - 1, .merge_distance = 0}).table.parts, 4);
  EXPECT_EQ(Train({.max_bytes = room(5) / 2, .merge_distance = 0}).table.parts, 4);
}

TEST_F(DetailsTest, ThreadsDoNotChangeThem) {
  const TrainedDetails one = Train({.jobs = 1});
  const TrainedDetails three = Train({.jobs = 3});
  EXPECT_EQ(one.table.codebook, three.table.codebook);
  EXPECT_EQ(one.table.rotation, three.table.rotation);
  EXPECT_EQ(one.table.list_size, three.table.list_size);
  EXPECT_EQ(one.table.codes, three.table.codes);
}

TEST_F(DetailsTest, TooFewFeaturesGiveNone) {
  image_idxs_.resize(2);
  locations_.resize(2);
  EXPECT_TRUE(Train({}).table.codes.empty());
}

}  // namespace
}  // namespace viewfix
