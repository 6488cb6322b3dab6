// SPDX-License-Identifier: BSD-3-Clause
#include "engine/localizer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "engine/scoring/scoring.h"
#include "models/model_writer.h"
#include "tests/testing/tiny_model.h"

namespace viewfix {
namespace {

// Blocks of random grey: enough corners and blobs for features.
std::vector<std::uint8_t> Blocks(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<std::uint8_t> cells(64 * 64);
  for (auto& cell : cells) cell = static_cast<std::uint8_t>(random());
  std::vector<std::uint8_t> pixels(std::size_t(width) * height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) pixels[y * width + x] = cells[(y / 9 % 64) * 64 + x / 9 % 64];
  }
  return pixels;
}

class LocalizerTest : public ::testing::Test {
 protected:
  Localizer Make(const ModelData& data) {
    file_ = *WriteModel(data);
    model_ = *ModelView::Open(file_);
    auto localizer = Localizer::Create(model_, {});
    EXPECT_TRUE(localizer.ok());
    return std::move(*localizer);
  }

  std::vector<std::uint8_t> file_;
  ModelView model_;
};

TEST_F(LocalizerTest, AnswersAreConsistent) {
  Localizer localizer = Make(TinyModelData());
  const auto pixels = Blocks(320, 240, 1);
  const auto fix = localizer.Localize({pixels.data(), 320, 240, 320});
  ASSERT_TRUE(fix.ok());
  const ModelScoring& scoring = model_.scoring();
  ASSERT_GE(fix->pair_idx, 0);
  EXPECT_EQ(scoring.pair_location[fix->pair_idx], fix->location_idx);
  EXPECT_EQ(model_.keyframes().pair[fix->keyframe_idx], fix->pair_idx);
  EXPECT_EQ(fix->score, localizer.pair_scores()[fix->pair_idx]);
  const auto locations = localizer.location_scores();
  EXPECT_EQ(fix->margin, locations[fix->location_idx] - locations[1 - fix->location_idx]);
  EXPECT_GE(fix->margin, 0);
  const auto& curve = model_.confidence();
  EXPECT_NEAR(fix->confidence, 1 / (1 + std::exp(-(curve.offset + curve.slope * fix->margin))),
              1e-6);
  EXPECT_TRUE(fix->localized);
}

TEST_F(LocalizerTest, FramesDoNotInfluenceEachOther) {
  Localizer localizer = Make(TinyModelData());
  const auto first = Blocks(320, 240, 1);
  const auto second = Blocks(320, 240, 2);
  const float alone = localizer.Localize({first.data(), 320, 240, 320})->score;
  (void)localizer.Localize({second.data(), 320, 240, 320});
  EXPECT_EQ(localizer.Localize({first.data(), 320, 240, 320})->score, alone);
}

TEST_F(LocalizerTest, APlainFrameIsNotLocalized) {
  Localizer localizer = Make(TinyModelData());
  const std::vector<std::uint8_t> grey(320 * 240, 128);
  const auto fix = localizer.Localize({grey.data(), 320, 240, 320});
  ASSERT_TRUE(fix.ok());
  EXPECT_FALSE(fix->localized);
  EXPECT_EQ(fix->reasons, kTooFewFeatures);
  EXPECT_EQ(fix->location_idx, -1);
  EXPECT_EQ(fix->keyframe_idx, -1);
}

TEST_F(LocalizerTest, BelowTheThresholdItSaysWhy) {
  ModelData data = TinyModelData();
  data.confidence = {.offset = -50, .slope = 0, .threshold = 0.5F};
  Localizer localizer = Make(data);
  const auto pixels = Blocks(320, 240, 1);
  const auto fix = localizer.Localize({pixels.data(), 320, 240, 320});
  ASSERT_TRUE(fix.ok());
  EXPECT_FALSE(fix->localized);
  EXPECT_NE(fix->reasons, 0U);
  EXPECT_GE(fix->location_idx, 0) << "the best guess stays for those who measure";
}

TEST_F(LocalizerTest, RivalsAreThoseWithinTheMargin) {
  ModelData data = TinyModelData();
  data.weight_scale.assign(4, 1e-6F);  // all scores are about the bias
  Localizer near = Make(data);
  const auto pixels = Blocks(320, 240, 1);
  EXPECT_EQ(near.Localize({pixels.data(), 320, 240, 320})->num_rivals, 1);
  data.bias = {5, 5, 0, 0};
  Localizer far = Make(data);
  EXPECT_EQ(far.Localize({pixels.data(), 320, 240, 320})->num_rivals, 0);
}

// What keeps a frame from being recognized, one after another, each image made to show it.
class ImageReasonsTest : public LocalizerTest {
 protected:
  // Of a model that is never sure.
  std::uint32_t ReasonsOf(const std::vector<std::uint8_t>& pixels) {
    ModelData data = TinyModelData();
    data.confidence = {.offset = -50, .slope = 0, .threshold = 0.5F};
    Localizer localizer = Make(data);
    const auto fix = localizer.Localize({pixels.data(), 320, 240, 320});
    EXPECT_TRUE(fix.ok());
    EXPECT_FALSE(fix->localized);
    return fix->reasons;
  }
  // Grey values `low` to `low` + 255 / `divisor`.
  static std::vector<std::uint8_t> Toned(int low, int divisor) {
    auto pixels = Blocks(320, 240, 1);
    for (auto& p : pixels) p = static_cast<std::uint8_t>(std::min(255, low + p / divisor));
    return pixels;
  }
  static std::vector<std::uint8_t> MovedSideways(int by) {
    const auto sharp = Blocks(320, 240, 1);
    auto moved = sharp;
    for (int y = 0; y < 240; ++y) {
      for (int x = 0; x < 320; ++x) {
        int sum = 0;
        for (int k = 0; k < by; ++k) sum += sharp[y * 320 + std::min(x + k, 319)];
        moved[y * 320 + x] = static_cast<std::uint8_t>(sum / by);
      }
    }
    return moved;
  }
  static constexpr std::uint32_t kOfTheImage = kBlurred | kDark | kOverexposed;
};

TEST_F(ImageReasonsTest, APlainWallIsNoFaultOfTheImage) {
  EXPECT_EQ(ReasonsOf(std::vector<std::uint8_t>(320 * 240, 128)), kTooFewFeatures);
}

TEST_F(ImageReasonsTest, ASharpImageHasNoFault) {
  EXPECT_EQ(ReasonsOf(Toned(0, 1)) & kOfTheImage, 0U);
  EXPECT_EQ(ReasonsOf(Toned(60, 2)) & kOfTheImage, 0U);
}

TEST_F(ImageReasonsTest, Dark) {
  EXPECT_EQ(ReasonsOf(Toned(0, 60)), kTooFewFeatures | kDark);
  EXPECT_EQ(ReasonsOf(Toned(0, 10)) & kOfTheImage, kDark);
}

TEST_F(ImageReasonsTest, Overexposed) {
  EXPECT_EQ(ReasonsOf(Toned(252, 120)), kTooFewFeatures | kOverexposed);
  EXPECT_EQ(ReasonsOf(Toned(215, 3)) & kOfTheImage, kOverexposed);
}

TEST_F(ImageReasonsTest, Blurred) {
  EXPECT_EQ(ReasonsOf(MovedSideways(14)) & kOfTheImage, kBlurred);
  EXPECT_EQ(ReasonsOf(MovedSideways(3)) & kOfTheImage, 0U);
}

TEST_F(ImageReasonsTest, AFrameThatIsLocalizedHasNoFault) {
  Localizer localizer = Make(TinyModelData());
  const auto pixels = MovedSideways(14);
  const auto fix = localizer.Localize({pixels.data(), 320, 240, 320});
  ASSERT_TRUE(fix->localized);
  EXPECT_EQ(fix->reasons, 0U);
}

// "floor1/hall" and "floor1/lobby", that score alike, and "floor2/lift", by `floor_margin` less.
ModelData TwoFloors(float floor_margin) {
  ModelData data = TinyModelData();
  data.locations = {"floor1/hall", "floor1/lobby", "floor2/lift"};
  data.pair_location = {0, 1, 2};
  data.pair_view = {0, 0, 0};
  data.views = {"left"};
  data.bias = {1, 1, 1 - floor_margin};
  data.weight_scale.assign(3, 1e-6F);
  data.weights.resize(data.weights.size() / 4 * 3);
  data.keyframe_pair = {0, 0, 0, 1, 1, 1, 2, 2};
  data.confidence = {.offset = -1, .slope = 2, .threshold = 0.5F};
  return data;
}

TEST_F(LocalizerTest, WhereAreasLookAlikeTheFloorIsSaid) {
  Localizer localizer = Make(TwoFloors(3));
  const auto pixels = Blocks(320, 240, 1);
  const auto fix = localizer.Localize({pixels.data(), 320, 240, 320});
  ASSERT_TRUE(fix->localized);
  EXPECT_EQ(fix->level, 1);
  EXPECT_EQ(fix->reasons, kAmbiguous);
  EXPECT_TRUE(fix->GuessIsRival());
  ASSERT_EQ(fix->num_rivals, 1);
  EXPECT_EQ(fix->rivals[0], 1 - fix->location_idx);
  EXPECT_NEAR(fix->confidence, 1 / (1 + std::exp(1 - 2 * 3)), 1e-3) << "of the floor";
}

TEST_F(LocalizerTest, WhereFloorsLookAlikeNothingIsSaid) {
  Localizer localizer = Make(TwoFloors(0.1F));
  const auto pixels = Blocks(320, 240, 1);
  const auto fix = localizer.Localize({pixels.data(), 320, 240, 320});
  EXPECT_FALSE(fix->localized);
  EXPECT_EQ(fix->level, 0);
  EXPECT_EQ(fix->reasons, kAmbiguous);
  EXPECT_TRUE(fix->GuessIsRival());
  EXPECT_EQ(fix->num_rivals, 2);
}

// That the only floor is the one says nothing: it would be said of any other building too.
TEST_F(LocalizerTest, AnOnlyFloorIsNoAnswer) {
  ModelData data = TwoFloors(3);
  data.locations[2] = "floor1/stair";
  Localizer localizer = Make(data);
  const auto pixels = Blocks(320, 240, 1);
  EXPECT_FALSE(localizer.Localize({pixels.data(), 320, 240, 320})->localized);
}

TEST_F(LocalizerTest, APlaceFarFromAllIsUnknown) {
  ModelData data = TwoFloors(3);
  data.bias[1] = -2;
  data.confidence.offset = -50;
  Localizer localizer = Make(data);
  const auto pixels = Blocks(320, 240, 1);
  const auto fix = localizer.Localize({pixels.data(), 320, 240, 320});
  EXPECT_FALSE(fix->localized);
  EXPECT_EQ(fix->reasons, kUnknownPlace);
  EXPECT_FALSE(fix->GuessIsRival());
}

// Gives a model the features of one image as details, each of a location that `owner` names.
ModelData WithDetailsOf(const std::vector<std::uint8_t>& pixels, ModelData data,
                        const std::function<int(int feature)>& owner) {
  FeatureOptions options;
  options.max_image_side = data.features.max_image_side;
  options.max_features = data.features.max_features;
  auto extractor = CreateFeatureExtractor(options);
  const int dim = data.features.descriptor_dim;
  FeatureSet features(options.max_features, dim);
  EXPECT_TRUE((*extractor)->Extract({pixels.data(), 320, 240, 320}, features).ok());
  std::vector<std::uint16_t> words(features.size());
  Vocabulary(data.words, dim).NearestWords(features.descriptors(), 1, words);
  data.details.parts = 1;  // a code for each feature
  data.details.codebook.resize(std::size_t{kCodesOfPart} * dim);
  data.details.rotation = NoRotation(dim);
  const int lists = 2 * static_cast<int>(data.words.size()) / dim;
  data.details.list_size.assign((data.locations.size() + 1) * lists, 0);
  for (int row = 0; row < static_cast<int>(data.locations.size()) * lists; ++row) {
    const int location = row / lists, list = row % lists;
    for (int i = 0; i < features.size(); ++i) {
      const int dark = features.keypoints()[i].laplacian_sign < 0 ? 1 : 0;
      if (2 * words[i] + dark != list || owner(i) != location) continue;
      const std::size_t code = data.details.codes.size();
      for (int b = 0; b < dim; ++b) {
        data.details.codebook[code * dim + b] = static_cast<std::int8_t>(
            features.descriptor(i)[b] - data.words[std::size_t(words[i]) * dim + b]);
      }
      ++data.details.list_size[row];
      data.details.codes.push_back(static_cast<std::uint8_t>(code));
    }
  }
  return data;
}

// A model whose details are the features of one image, all of the second location's.
ModelData DetailsOf(const std::vector<std::uint8_t>& pixels) {
  return WithDetailsOf(pixels, TinyModelData(), [](int) { return 1; });
}

TEST_F(LocalizerTest, WhereDetailsOfOneFloorsAreasAreSeenTheFloorIsSaid) {
  const auto pixels = Blocks(320, 240, 1);
  ModelData data = WithDetailsOf(pixels, TwoFloors(0), [](int i) { return i % 2; });
  data.confidence = {.offset = -12, .slope = 2, .threshold = 0.5F};
  Localizer localizer = Make(data);
  const auto fix = localizer.Localize({pixels.data(), 320, 240, 320});
  ASSERT_TRUE(fix->localized);
  EXPECT_EQ(fix->level, 1);
  EXPECT_EQ(fix->reasons, kAmbiguous);
  ASSERT_EQ(fix->num_rivals, 1);
  EXPECT_EQ(fix->rivals[0], 1 - fix->location_idx);
  EXPECT_GT(fix->rival_evidence, fix->evidence / 2);
}

// The logit grows by slope * close_weight * sqrt(close votes), the area's, where its floor is said,
// too. Details are the features themselves, or every `near_every`-th is and the others are 50 away.
TEST_F(LocalizerTest, ConfidenceGrowsWithTheVotesOfCloseDetails) {
  const auto pixels = Blocks(320, 240, 1);
  const auto fix_with = [&](float close_weight, int every, int near_every = 1) {
    ModelData data = WithDetailsOf(pixels, TwoFloors(0), [&](int i) { return i % every; });
    data.confidence = {.offset = -2, .slope = 0.125F, .threshold = 0.3F};
    data.details.close_weight = close_weight;
    for (std::size_t code = 0; code < data.details.codes.size(); ++code) {
      std::int8_t& value = data.details.codebook[code * data.features.descriptor_dim];
      if (code % near_every != 0) value = static_cast<std::int8_t>(value + (value < 0 ? 50 : -50));
    }
    Localizer localizer = Make(data);
    return *localizer.Localize({pixels.data(), 320, 240, 320});
  };
  const auto logit_of = [](const Fix& fix) {
    return std::log(fix.confidence / (1 - fix.confidence));
  };
  const auto expect_grown = [&](const Fix& without, const Fix& with, float weight) {
    EXPECT_NEAR(logit_of(with) - logit_of(without),
                0.125F * weight * std::sqrt(static_cast<float>(with.num_inliers)), 1e-2);
  };
  expect_grown(fix_with(0, 1), fix_with(0.5F, 1), 0.5F);
  const Fix few = fix_with(0.5F, 1, 4);
  EXPECT_GT(few.num_inliers, few.num_features * 3 / 4) << "far ones speak, too";
  EXPECT_NEAR(logit_of(few) - logit_of(fix_with(0, 1, 4)),
              0.125F * 0.5F * std::sqrt(static_cast<float>(few.num_inliers) / 4), 0.1);
  const Fix without = fix_with(0, 2), with = fix_with(0.5F, 2);  // two areas of one floor
  EXPECT_EQ(without.level, 1);
  EXPECT_EQ(with.level, 1);
  EXPECT_LT(with.num_inliers, with.num_features * 3 / 4);
  expect_grown(without, with, 0.5F);
}

TEST_F(LocalizerTest, DetailsDecide) {
  const auto pixels = Blocks(320, 240, 1);
  ModelData data = DetailsOf(pixels);
  data.bias = {50, 50, 0, 0};  // the scores say the first location
  Localizer localizer = Make(data);
  const auto fix = localizer.Localize({pixels.data(), 320, 240, 320});
  ASSERT_TRUE(fix.ok());
  EXPECT_EQ(fix->location_idx, 1);
  EXPECT_EQ(model_.scoring().pair_location[fix->pair_idx], 1);
  EXPECT_EQ(model_.keyframes().pair[fix->keyframe_idx], fix->pair_idx);
  EXPECT_GT(fix->num_inliers, fix->num_features * 9 / 10);
  EXPECT_GT(fix->margin, 10);
  EXPECT_EQ(fix->rival_evidence, 0);
  EXPECT_EQ(fix->num_rivals, 0);
  const auto points = localizer.SeenPoints();
  EXPECT_EQ(std::count_if(points.begin(), points.end(), [](const auto& p) { return p.matched; }),
            fix->num_inliers);
}

TEST_F(LocalizerTest, AFrameWithoutKnownDetailsIsRefused) {
  ModelData data = DetailsOf(Blocks(320, 240, 1));
  data.confidence = {.offset = -3, .slope = 2, .threshold = 0.5F};
  Localizer localizer = Make(data);
  std::vector<std::uint8_t> other(320 * 240);
  for (int i = 0; i < 320 * 240; ++i) {
    other[i] = static_cast<std::uint8_t>(128 + 100 * ((i % 320 - 160) / 40 % 2));
  }
  const auto fix = localizer.Localize({other.data(), 320, 240, 320});
  ASSERT_TRUE(fix.ok());
  EXPECT_FALSE(fix->localized);
  EXPECT_NE(fix->reasons, 0U);
}

TEST_F(LocalizerTest, HostileImagesAreErrors) {
  Localizer localizer = Make(TinyModelData());
  const std::vector<std::uint8_t> pixels(100, 0);
  EXPECT_FALSE(localizer.Localize({}).ok());
  EXPECT_FALSE(localizer.Localize({pixels.data(), 0, 10, 10}).ok());
  EXPECT_FALSE(localizer.Localize({pixels.data(), 10, -1, 10}).ok());
  EXPECT_FALSE(localizer.Localize({pixels.data(), 10, 10, 9}).ok());
  EXPECT_FALSE(localizer.Localize({pixels.data(), 20000, 10, 20000}).ok());
  EXPECT_FALSE(localizer.Localize({pixels.data(), 16000, 16000, 16000}).ok());
}

TEST_F(LocalizerTest, OddShapesAreOutcomes) {
  Localizer localizer = Make(TinyModelData());
  const auto pixels = Blocks(10000, 10, 1);
  for (const auto& [width, height] :
       {std::pair(1, 1), std::pair(10000, 10), std::pair(10, 10000)}) {
    const auto fix = localizer.Localize({pixels.data(), width, height, width});
    ASSERT_TRUE(fix.ok());
    EXPECT_FALSE(fix->localized && fix->num_features < kMinFeatures);
  }
}

TEST_F(LocalizerTest, AWindowOutOfRangeIsRefused) {
  ModelData data = TinyModelData();
  AddTinyMaps(data);
  const auto file = *WriteModel(data);
  const auto model = ModelView::Open(file);
  ASSERT_TRUE(model.ok());
  for (const int window : {-1, 1, 2, 9}) {
    EXPECT_EQ(Localizer::Create(*model, {.window = window}).status().code(),
              StatusCode::kInvalidArgument);
  }
  EXPECT_FALSE(Localizer::Create(*model, {.window = 5, .frame_interval_s = 0}).ok());
  EXPECT_TRUE(Localizer::Create(*model, {.window = 5}).ok());
}

TEST_F(LocalizerTest, FeaturesThatCannotBeReproducedAreRefused) {
  ModelData data = TinyModelData();
  ++data.features.version;
  const auto file = *WriteModel(data);
  const auto created = Localizer::Create(*ModelView::Open(file), {});
  EXPECT_EQ(created.status().code(), StatusCode::kUnsupported);
  EXPECT_THAT(created.status().text(), ::testing::HasSubstr("cannot reproduce"));
}

TEST_F(LocalizerTest, AFeatureThisBuildLacksIsRefused) {
  ModelData data = TinyModelData();
  data.features.type = static_cast<std::uint8_t>(FeatureType::kSift);
  const auto file = *WriteModel(data);
  EXPECT_EQ(Localizer::Create(*ModelView::Open(file), {}).status().code(),
            StatusCode::kUnsupported);
}

}  // namespace
}  // namespace viewfix
