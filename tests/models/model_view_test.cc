// SPDX-License-Identifier: BSD-3-Clause
#include "models/model_view.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <utility>

#include "models/huffman_decoder.h"
#include "models/model_writer.h"
#include "models/viewfix_generated.h"
#include "tests/testing/tiny_model.h"

namespace viewfix {
namespace {

using ::testing::HasSubstr;

using Bytes = std::vector<std::uint8_t>;

// A hash that matches, so that a test reaches the checks behind it.
void Rehash(Bytes& file) {
  const auto hash = HashModel(file);
  std::copy(hash.begin(), hash.end(), file.begin() + kModelHashOffset);
}

TEST(ModelView, ReadsWhatWasWritten) {
  const ModelData data = TinyModelData();
  const auto file = WriteModel(data);
  ASSERT_TRUE(file.ok()) << file.status().text();
  const auto view = ModelView::Open(*file);
  ASSERT_TRUE(view.ok()) << view.status().text();
  EXPECT_EQ(view->features().max_features, data.features.max_features);
  EXPECT_EQ(view->features().threshold, data.features.threshold);
  EXPECT_THAT(view->vocabulary().words, ::testing::ElementsAreArray(data.words));
  EXPECT_EQ(UnpackModel(*view).weights, data.weights);
  EXPECT_THAT(view->scoring().bias, ::testing::ElementsAreArray(data.bias));
  EXPECT_EQ(view->location_name(1), data.locations[1]);
  EXPECT_EQ(view->view_name(0), data.views[0]);
  EXPECT_EQ(view->record(), data.record);
  EXPECT_EQ(view->metric(), data.metric);
}

TEST(ModelView, ReadsTheConfidenceOfPoses) {
  ModelData data = TinyModelData();
  EXPECT_FALSE(ModelView::Open(*WriteModel(data))->pose_confidence());
  data.pose_confidence = {-1, {0.5F, 2, 3}, 0.75F};
  const auto file = WriteModel(data);
  ASSERT_TRUE(file.ok()) << file.status().text();
  const auto curve = ModelView::Open(*file)->pose_confidence();
  ASSERT_TRUE(curve);
  EXPECT_EQ(curve->offset, -1);
  EXPECT_EQ(curve->weights, data.pose_confidence->weights);
  EXPECT_EQ(curve->threshold, 0.75F);
}

TEST(ModelView, ReadsMapsAndFloorPlan) {
  ModelData data = TinyModelData();
  EXPECT_FALSE(ModelView::Open(*WriteModel(data))->has_floor_plan());
  AddTinyMaps(data);
  AddTinyFloorPlan(data);
  const auto file = WriteModel(data);
  ASSERT_TRUE(file.ok()) << file.status().text();
  const auto view = ModelView::Open(*file);
  EXPECT_TRUE(view->metric(0));
  EXPECT_FALSE(view->metric(1));
  EXPECT_EQ(view->MapOf(20), 1);
  EXPECT_THAT(view->floor_plan().picture, ::testing::ElementsAreArray(data.floor_plan.picture));
  EXPECT_THAT(view->floor_plan().site_from_pixel,
              ::testing::ElementsAreArray(data.floor_plan.site_from_pixel));
  EXPECT_EQ(view->floor_plan().height, data.floor_plan.height);
}

TEST(ModelView, WithoutAWordOnItsMapsTheModelSpeaksForThem) {
  ModelData data = TinyModelData();
  AddTinyMaps(data);
  data.map_metric.clear();
  const auto file = WriteModel(data);
  EXPECT_TRUE(ModelView::Open(*file)->metric(1));
}

TEST(ModelView, SameDataSameBytes) { EXPECT_EQ(TinyModel(), TinyModel()); }

// A model with two small maps.
ModelData MappedModelData() {
  ModelData data = TinyModelData();
  data.camera = {.model = 2,
                 .width = 320,
                 .height = 240,
                 .intrinsics = {280, 281, 159.5, 119.5},
                 .distortion = {0.1, -0.05, 0.001, 0.002, 0.01, 0, 0, 0}};
  data.map_begin = {0, 6, 10};
  data.map_origin = {{0, 1, 2}, {-3, 4, -5}};
  data.map_step = {0.001F, 0.002F};
  for (std::int16_t l = 0; l < 10; ++l) {
    data.landmark_position.push_back({l, static_cast<std::int16_t>(-l), 32767});
    data.landmark_laplacian_sign.push_back(static_cast<std::int8_t>(l % 3 - 1));
    data.landmark_rarity.push_back(static_cast<std::uint8_t>(255 / (1 + l)));
  }
  data.landmark_descriptors.assign(std::size_t{10} * data.features.descriptor_dim, 7);
  for (int i = 0; i < 10 * kLandmarkChromaDim; ++i) {
    data.landmark_chroma.push_back(static_cast<std::int8_t>(i % 33 - 16));
  }
  data.pixel_sigma = 0.5F;
  data.map_metric = {1, 0};
  // Of the keyframes with a pose (even ones) the last has no landmarks.
  data.keyframe_landmark_begin = {0, 4, 4, 8, 8, 12, 12, 12, 12};
  data.keyframe_landmarks = {0, 1, 2, 5, 2, 3, 4, 5, 6, 7, 8, 9};
  return data;
}

TEST(ModelView, ReadsLandmarks) {
  const ModelData data = MappedModelData();
  const auto file = WriteModel(data);
  ASSERT_TRUE(file.ok()) << file.status().text();
  EXPECT_EQ(*WriteModel(data), *file);
  const ModelView view = *ModelView::Open(*file);
  ASSERT_TRUE(view.has_landmarks());
  const ModelLandmarks& landmarks = view.landmarks();
  EXPECT_EQ(landmarks.size, 10);
  EXPECT_EQ(landmarks.num_maps, 2);
  EXPECT_THAT(landmarks.map_begin, ::testing::ElementsAreArray(data.map_begin));
  EXPECT_THAT(landmarks.map_origin, ::testing::ElementsAre(0, 1, 2, -3, 4, -5));
  EXPECT_THAT(landmarks.map_step, ::testing::ElementsAreArray(data.map_step));
  EXPECT_THAT(landmarks.position.subspan(9, 3), ::testing::ElementsAre(3, -3, 32767));
  EXPECT_THAT(landmarks.descriptors, ::testing::ElementsAreArray(data.landmark_descriptors));
  EXPECT_THAT(landmarks.laplacian_sign, ::testing::ElementsAreArray(data.landmark_laplacian_sign));
  EXPECT_EQ(landmarks.pixel_sigma, 0.5F);
  EXPECT_THAT(landmarks.rarity, ::testing::ElementsAreArray(data.landmark_rarity));
  EXPECT_THAT(landmarks.chroma, ::testing::ElementsAreArray(data.landmark_chroma));
  EXPECT_TRUE(view.metric(0));
  EXPECT_FALSE(view.metric(1));
  EXPECT_THAT(view.keyframes().landmarks, ::testing::ElementsAreArray(data.keyframe_landmarks));
  EXPECT_THAT(view.camera().intrinsics, ::testing::ElementsAreArray(data.camera.intrinsics));
  EXPECT_THAT(view.camera().distortion, ::testing::ElementsAreArray(data.camera.distortion));
  for (std::uint32_t l = 0; l < 10; ++l) EXPECT_EQ(view.MapOf(l), l < 6 ? 0 : 1);
}

TEST(ModelView, MapsWithoutLandmarksAreStillCounted) {
  ModelData data = MappedModelData();
  data.map_begin = {0, 0, 10, 10};
  data.map_metric.push_back(1);
  data.map_origin.push_back({0, 0, 0});
  data.map_step.push_back(1);
  const auto file = WriteModel(data);
  ASSERT_TRUE(file.ok()) << file.status().text();
  EXPECT_EQ(ModelView::Open(*file)->MapOf(0), 1);
  EXPECT_EQ(ModelView::Open(*file)->MapOf(9), 1);
}

TEST(ModelView, ReadsDetails) {
  ModelData data = TinyModelData();
  EXPECT_FALSE(ModelView::Open(*WriteModel(data))->has_details());
  AddTinyDetails(data);
  const auto file = WriteModel(data);
  ASSERT_TRUE(file.ok()) << file.status().text();
  EXPECT_EQ(*WriteModel(data), *file);
  const ModelView view = *ModelView::Open(*file);
  ASSERT_TRUE(view.has_details());
  const ModelDetails& details = view.details();
  EXPECT_EQ(details.size * details.parts, static_cast<int>(data.details.codes.size()));
  EXPECT_EQ(details.parts, data.details.parts);
  EXPECT_THAT(details.rotation, ::testing::ElementsAreArray(data.details.rotation));
  EXPECT_THAT(details.codebook, ::testing::ElementsAreArray(data.details.codebook));
  EXPECT_THAT(details.list_size, ::testing::ElementsAreArray(data.details.list_size));
  EXPECT_THAT(details.codes, ::testing::ElementsAreArray(data.details.codes));
  EXPECT_EQ(details.likeness_weight, data.details.likeness_weight);
  EXPECT_EQ(details.close_weight, data.details.close_weight);
}

// Words, and how often each occurs, of keyframe k.
std::vector<std::pair<int, int>> WordsOf(const ModelKeyframes& keyframes, int k) {
  std::vector<std::pair<int, int>> words;
  int word = -1;
  for (std::uint32_t j = keyframes.word_begin[k]; j < keyframes.word_begin[k + 1]; ++j) {
    word += StepOf(keyframes.words[j]);
    const int count = CountOf(keyframes.words[j]);
    if (count > 0) words.emplace_back(word, count);
  }
  return words;
}

TEST(ModelView, ReadsKeyframesWords) {
  ModelData data = TinyModelData();
  data.keyframe_word_begin = {0, 3};
  data.keyframe_words = {0, 1, 31};
  data.keyframe_counts = {1, 200, 7};
  const int keyframes = static_cast<int>(data.keyframe_pair.size());
  for (int k = 1; k < keyframes; ++k) {
    data.keyframe_words.push_back(31);
    data.keyframe_counts.push_back(2);
    data.keyframe_word_begin.push_back(static_cast<std::uint32_t>(data.keyframe_words.size()));
  }
  const auto file = WriteModel(data);
  ASSERT_TRUE(file.ok()) << file.status().text();
  const ModelView view = *ModelView::Open(*file);
  using ::testing::ElementsAre;
  using ::testing::Pair;
  EXPECT_THAT(WordsOf(view.keyframes(), 0), ElementsAre(Pair(0, 1), Pair(1, 7), Pair(31, 7)));
  for (int k = 1; k < keyframes; ++k) {
    EXPECT_THAT(WordsOf(view.keyframes(), k), ElementsAre(Pair(31, 2)));
  }
}

TEST(ModelView, ReadsWordsThatLieFarApart) {
  ModelData data = TinyModelData();
  const std::size_t dim = data.features.descriptor_dim;
  data.words.resize(1000 * dim, 1);
  data.weights.resize(1000 * data.pair_location.size(), 1);
  for (std::size_t k = 0; k + 1 < data.keyframe_word_begin.size(); ++k) {
    data.keyframe_words[data.keyframe_word_begin[k + 1] - 1] = 999;
  }
  const auto file = WriteModel(data);
  ASSERT_TRUE(file.ok()) << file.status().text();
  const ModelView view = *ModelView::Open(*file);
  for (int k = 0; k < view.keyframes().size; ++k) {
    std::vector<std::pair<int, int>> expected;
    for (std::uint32_t j = data.keyframe_word_begin[k]; j < data.keyframe_word_begin[k + 1]; ++j) {
      expected.emplace_back(data.keyframe_words[j], data.keyframe_counts[j]);
    }
    EXPECT_EQ(WordsOf(view.keyframes(), k), expected);
  }
}

TEST(ModelView, ReadsKeyframesNamesAndPoses) {
  ModelData data = TinyModelData();
  EXPECT_EQ(ModelView::Open(*WriteModel(data))->keyframe_name(3), "");
  // Names that begin alike, the longest included.
  const std::string long_folder(kMaxKeyframeNameBytes - 6, 'd');
  data.keyframe_names = {
      "a/1.jpg",  "a/10.jpg", "a/2.jpg", "b", "b", long_folder + "/1.jpg", long_folder + "/2.jpg",
      long_folder};
  ASSERT_EQ(data.keyframe_names.size(), data.keyframe_pair.size());
  const auto file = WriteModel(data);
  ASSERT_TRUE(file.ok()) << file.status().text();
  const ModelView view = *ModelView::Open(*file);
  for (std::size_t k = 0; k < data.keyframe_names.size(); ++k) {
    EXPECT_EQ(view.keyframe_name(static_cast<int>(k)), data.keyframe_names[k]);
    EXPECT_THAT(view.keyframes().pose.subspan(7 * k, 7),
                ::testing::ElementsAreArray(data.keyframe_pose[k]));
  }
  EXPECT_EQ(*WriteModel(UnpackModel(view)), *file);
}

TEST(ModelView, ReadsLandmarksThatLieFarApart) {
  ModelData data = MappedModelData();
  constexpr std::size_t kMany = 1000;
  data.map_begin = {0, 6, kMany};
  data.landmark_position.resize(kMany);
  data.landmark_laplacian_sign.resize(kMany, 1);
  data.landmark_rarity.resize(kMany, 255);
  data.landmark_chroma.resize(kMany * kLandmarkChromaDim, 1);
  data.landmark_descriptors.resize(kMany * data.features.descriptor_dim, 3);
  data.keyframe_landmarks = {0, 1, 2, 5, 2, 3, 4, 5, 6, 261, 517, 999};  // steps of 255, 256, 482
  const auto file = WriteModel(data);
  ASSERT_TRUE(file.ok()) << file.status().text();
  EXPECT_THAT(ModelView::Open(*file)->keyframes().landmarks,
              ::testing::ElementsAreArray(data.keyframe_landmarks));
}

TEST(ModelView, CopiesOutliveTheViewTheyAreOf) {
  ModelData data = TinyModelData();
  AddTinyDetails(data);
  const Bytes file = *WriteModel(data);
  const ModelView copy = ModelView(*ModelView::Open(file));
  EXPECT_THAT(copy.vocabulary().words, ::testing::ElementsAreArray(data.words));
  EXPECT_THAT(copy.details().list_size, ::testing::ElementsAreArray(data.details.list_size));
}

// The tables of a file whose bytes are a test's own, to be changed in their places.
template <typename T>
T* Mutable(const flatbuffers::Vector<T>* vector) {
  return const_cast<T*>(vector->data());  // NOLINT(cppcoreguidelines-pro-type-const-cast)
}

void ExpectRefused(const std::function<void(const fb::Model&)>& change) {
  ModelData data = MappedModelData();
  AddTinyDetails(data);
  data.keyframe_names.assign(data.keyframe_pair.size(), "a/1.jpg");
  Bytes file = *WriteModel(data);
  ASSERT_TRUE(ModelView::Open(file).ok());
  change(*fb::GetModel(file.data() + kModelHeaderBytes));
  Rehash(file);
  EXPECT_EQ(ModelView::Open(file).status().code(), StatusCode::kCorrupt);
}

// What the writer would not write.
TEST(ModelView, RowsThatAreNotThereAreRefused) {
  ExpectRefused([](const fb::Model& m) {  // more words than there is room for
    Mutable(m.keyframes()->word_begin())[m.keyframes()->word_begin()->size() - 1] = 0xFFFFFFFF;
  });
  ExpectRefused([](const fb::Model& m) { Mutable(m.keyframes()->word_begin())[1] = 0xFFFF; });
  ExpectRefused([](const fb::Model& m) { Mutable(m.keyframes()->landmark_begin())[1] = 9; });
  ExpectRefused([](const fb::Model& m) { Mutable(m.keyframes()->landmark_begin())[0] = 1; });
  ExpectRefused([](const fb::Model& m) {
    Mutable(m.keyframes()->landmark_begin())[m.keyframes()->landmark_begin()->size() - 1] =
        0xFFFFFFFF;
  });
  ExpectRefused([](const fb::Model& m) { Mutable(m.keyframes()->has_pose())[1] = 1; });
  ExpectRefused([](const fb::Model& m) { Mutable(m.keyframes()->has_pose())[6] = 0; });
  // Names are stored: as much of a name before it as there is not.
  ExpectRefused([](const fb::Model& m) { Mutable(m.keyframes()->names()->rows())[0] = 1; });
  ExpectRefused([](const fb::Model& m) {  // a code length of 0
    Mutable(m.vocabulary()->words()->tables())[0] = 0;
  });
  ExpectRefused([](const fb::Model& m) {  // a step beyond the last landmark
    Mutable(m.keyframes()->landmarks()->rows())[0] = 200;
  });
}

TEST(ModelView, TinyModelsHaveNoLandmarks) {
  const Bytes file = TinyModel();
  EXPECT_FALSE(ModelView::Open(file)->has_landmarks());
}

// A complete code: 64 bytes of 7 bits, as many of 8, the others of 9; `first` has 7.
Bytes SkewedTable(int first) {
  Bytes table;
  for (int byte = 0; byte < 256; byte += 2) {
    const int nth = (byte - first + 256) % 256;
    table.push_back(nth < 64 ? 0x77 : nth < 128 ? 0x88 : 0x99);
  }
  return table;
}

// All that may be encoded is, each by a table of its own.
ModelData EncodedModelData() {
  ModelData data = MappedModelData();
  AddTinyDetails(data);
  data.keyframe_names = {"a/1.jpg", "a/10.jpg", "a/2.jpg", "b", "b", "c/1.jpg", "c/2.jpg", "d"};
  data.golden.width = {320};
  data.golden.height = {240};
  data.golden.begin = {0, 2};
  data.golden.keypoints.assign(10, 1);
  data.golden.laplacian_sign = {1, -1};
  data.golden.descriptors.assign(std::size_t{2} * data.features.descriptor_dim, 5);
  data.golden.pair = {0};
  data.golden.has_pose = {0};
  data.golden.pose = {{}};
  data.code_tables = {SkewedTable(0),  SkewedTable(2),  SkewedTable(4),
                      SkewedTable(6),  SkewedTable(8),  SkewedTable(10),
                      SkewedTable(12), SkewedTable(14), SkewedTable(16)};
  return data;
}

TEST(ModelView, KeepsTheTablesOfEachOfItsRows) {
  const ModelData data = EncodedModelData();
  const auto file = WriteModel(data);
  ASSERT_TRUE(file.ok()) << file.status().text();
  const ModelData read = UnpackModel(*ModelView::Open(*file));
  EXPECT_EQ(read.code_tables.words, data.code_tables.words);
  EXPECT_EQ(read.code_tables.weights, data.code_tables.weights);
  EXPECT_EQ(read.code_tables.keyframe_words, data.code_tables.keyframe_words);
  EXPECT_EQ(read.code_tables.keyframe_landmarks, data.code_tables.keyframe_landmarks);
  EXPECT_EQ(read.code_tables.keyframe_names, data.code_tables.keyframe_names);
  EXPECT_EQ(read.code_tables.landmark_descriptors, data.code_tables.landmark_descriptors);
  EXPECT_EQ(read.code_tables.landmark_chroma, data.code_tables.landmark_chroma);
  EXPECT_EQ(read.code_tables.detail_lists, data.code_tables.detail_lists);
  EXPECT_EQ(read.code_tables.golden_descriptors, data.code_tables.golden_descriptors);
  EXPECT_EQ(read.weights, data.weights);
  EXPECT_EQ(read.keyframe_words, data.keyframe_words);
  EXPECT_EQ(read.keyframe_landmarks, data.keyframe_landmarks);
  EXPECT_EQ(read.keyframe_names, data.keyframe_names);
  EXPECT_EQ(read.landmark_descriptors, data.landmark_descriptors);
  EXPECT_EQ(read.landmark_chroma, data.landmark_chroma);
  EXPECT_EQ(read.details.list_size, data.details.list_size);
  EXPECT_EQ(read.golden.descriptors, data.golden.descriptors);
}

TEST(ModelView, TablesOfNoCompleteCodeAreNotWritten) {
  ModelData data = EncodedModelData();
  data.code_tables.detail_lists.pop_back();
  EXPECT_FALSE(WriteModel(data).ok());
}

enum class Holds { kNeither, kLandmarks, kDetails, kAllEncoded };

class WholeModel : public ::testing::TestWithParam<Holds> {
 protected:
  static Bytes File() {
    if (GetParam() == Holds::kLandmarks) return *WriteModel(MappedModelData());
    if (GetParam() == Holds::kAllEncoded) return *WriteModel(EncodedModelData());
    ModelData data = TinyModelData();
    if (GetParam() == Holds::kDetails) AddTinyDetails(data);
    return *WriteModel(data);
  }
};

INSTANTIATE_TEST_SUITE_P(ModelView, WholeModel,
                         ::testing::Values(Holds::kNeither, Holds::kLandmarks, Holds::kDetails,
                                           Holds::kAllEncoded),
                         [](const auto& param) {
                           return param.param == Holds::kLandmarks    ? "with_landmarks"
                                  : param.param == Holds::kDetails    ? "with_details"
                                  : param.param == Holds::kAllEncoded ? "all_encoded"
                                                                      : "without";
                         });

TEST_P(WholeModel, IsUnpackedWhole) {
  const Bytes file = File();
  EXPECT_EQ(*WriteModel(UnpackModel(*ModelView::Open(file))), file);
}

TEST_P(WholeModel, RefusesEveryTruncation) {
  const Bytes file = File();
  for (std::size_t size = 0; size < file.size(); ++size) {
    const Bytes part(file.begin(), file.begin() + size);
    EXPECT_FALSE(ModelView::Open(part).ok()) << size;
  }
}

TEST_P(WholeModel, RefusesEveryFlippedBit) {
  Bytes file = File();
  for (std::size_t i = 0; i < file.size(); ++i) {
    const auto flipped = static_cast<std::uint8_t>(file[i] ^ (1 << (i % 8)));
    const std::uint8_t good = std::exchange(file[i], flipped);
    EXPECT_FALSE(ModelView::Open(file).ok()) << "byte " << i;
    file[i] = good;
  }
  EXPECT_TRUE(ModelView::Open(file).ok());
}

TEST(ModelView, RefusesBytesAfterItsEnd) {
  Bytes file = TinyModel();
  file.push_back(0);
  EXPECT_THAT(ModelView::Open(file).status().text(), HasSubstr("after its end"));
}

TEST(ModelView, NewerFormatSaysSo) {
  Bytes file = TinyModel();
  file[8] = kModelFormatVersion + 1;
  Rehash(file);
  const Status status = ModelView::Open(file).status();
  EXPECT_EQ(status.code(), StatusCode::kUnsupported);
  EXPECT_THAT(status.text(), HasSubstr("newer"));
}

TEST(ModelView, OlderFormatSaysSo) {
  Bytes file = TinyModel();
  file[8] = kModelFormatVersion - 1;
  Rehash(file);
  const Status status = ModelView::Open(file).status();
  EXPECT_EQ(status.code(), StatusCode::kUnsupported);
  EXPECT_THAT(status.text(), HasSubstr("train it again"));
}

TEST(ModelView, UnalignedBytesAreRefused) {
  const Bytes file = TinyModel();
  Bytes shifted(file.size() + 1);
  std::copy(file.begin(), file.end(), shifted.begin() + 1);
  EXPECT_EQ(ModelView::Open(std::span(shifted).subspan(1)).status().code(),
            StatusCode::kInvalidArgument);
}

// Behind a matching hash, any bytes are refused or read, and never crash the reader.
TEST_P(WholeModel, SurvivesHostileBytesBehindAMatchingHash) {
  const Bytes good = File();
  std::mt19937 random(7);
  int refused = 0;
  for (int round = 0; round < 3000; ++round) {
    Bytes file = good;
    const int changes = 1 + static_cast<int>(random() % 4);
    for (int c = 0; c < changes; ++c) {
      const std::size_t at = kModelHeaderBytes + random() % (file.size() - kModelHeaderBytes);
      file[at] = static_cast<std::uint8_t>(random());
    }
    Rehash(file);
    const auto view = ModelView::Open(file);
    refused += view.ok() ? 0 : 1;
    if (!view.ok()) continue;
    for (int l = 0; l < view->scoring().num_locations; ++l) (void)view->location_name(l).size();
    for (int p = 0; p < view->scoring().num_pairs; ++p) {
      ASSERT_LT(view->scoring().pair_location[p], view->scoring().num_locations);
      ASSERT_LT(view->scoring().pair_view[p], view->scoring().num_views);
    }
    for (int k = 0; k < view->keyframes().size; ++k) {
      for (const auto& [word, count] : WordsOf(view->keyframes(), k)) {
        ASSERT_LT(word, view->vocabulary().num_words);
      }
    }
    for (const std::uint32_t l : view->keyframes().landmarks) {
      ASSERT_LT(view->MapOf(l), view->landmarks().num_maps);
    }
  }
  EXPECT_GT(refused, 150);
}

struct Broken {
  const char* name;
  std::function<void(ModelData&)> break_it;
};

class BrokenModel : public ::testing::TestWithParam<Broken> {};

TEST_P(BrokenModel, IsRefused) {
  ModelData data = TinyModelData();
  AddTinyMaps(data);
  AddTinyFloorPlan(data);
  ASSERT_TRUE(WriteModel(data).ok());
  GetParam().break_it(data);
  EXPECT_FALSE(WriteModel(data).ok());
}

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

INSTANTIATE_TEST_SUITE_P(
    Semantics, BrokenModel,
    ::testing::Values(
        Broken{"side_too_large", [](ModelData& d) { d.features.max_image_side = 5000; }},
        Broken{"no_features", [](ModelData& d) { d.features.max_features = 0; }},
        Broken{"threshold_nan", [](ModelData& d) { d.features.threshold = kNan; }},
        Broken{"words_missing", [](ModelData& d) { d.words.pop_back(); }},
        Broken{"name_too_long",
               [](ModelData& d) {
                 d.keyframe_names.assign(d.keyframe_pair.size(),
                                         std::string(kMaxKeyframeNameBytes + 1, 'a'));
               }},
        Broken{"names_missing", [](ModelData& d) { d.keyframe_names = {"one"}; }},
        Broken{"name_cut_by_a_zero",
               [](ModelData& d) {
                 d.keyframe_names.assign(d.keyframe_pair.size(), std::string("a\0b", 3));
               }},
        Broken{"no_words", [](ModelData& d) { d.words.clear(); }},
        Broken{"locations_out_of_order",
               [](ModelData& d) { std::swap(d.locations[0], d.locations[1]); }},
        Broken{"empty_name", [](ModelData& d) { d.views[0] = ""; }},
        Broken{"name_twice", [](ModelData& d) { d.views[1] = d.views[0]; }},
        Broken{"bias_nan", [](ModelData& d) { d.bias[0] = kNan; }},
        Broken{"bias_short", [](ModelData& d) { d.bias.pop_back(); }},
        Broken{"scale_infinite",
               [](ModelData& d) { d.weight_scale[0] = std::numeric_limits<float>::infinity(); }},
        Broken{"weights_short", [](ModelData& d) { d.weights.pop_back(); }},
        Broken{"weights_of_a_word_missing",
               [](ModelData& d) { d.weights.resize(d.weights.size() - 4); }},
        Broken{"weight_too_large", [](ModelData& d) { d.weights[1] = 8; }},
        Broken{"pair_of_no_location", [](ModelData& d) { d.pair_location[3] = 2; }},
        Broken{"pair_twice", [](ModelData& d) { d.pair_view[3] = d.pair_view[2]; }},
        Broken{"location_without_pair", [](ModelData& d) { d.locations.push_back("zoo"); }},
        Broken{"view_out_of_range", [](ModelData& d) { d.pair_view[3] = 9; }},
        Broken{"slope_negative", [](ModelData& d) { d.confidence.slope = -1; }},
        Broken{"threshold_over_one", [](ModelData& d) { d.confidence.threshold = 1.5F; }},
        Broken{"pose_weight_infinite",
               [](ModelData& d) {
                 d.pose_confidence = {0, {1, std::numeric_limits<float>::infinity(), 0}, 0.5F};
               }},
        Broken{
            "pose_offset_not_a_number",
            [](ModelData&
                   d) { d.pose_confidence = {std::numeric_limits<float>::quiet_NaN(), {}, 0.5F}; }},
        Broken{"pose_threshold_negative", [](ModelData& d) { d.pose_confidence = {0, {}, -0.5F}; }},
        Broken{"keyframe_of_no_pair", [](ModelData& d) { d.keyframe_pair.back() = 99; }},
        Broken{"keyframe_words_out_of_order",
               [](ModelData& d) { std::swap(d.keyframe_words[0], d.keyframe_words[1]); }},
        Broken{"keyframe_word_out_of_range", [](ModelData& d) { d.keyframe_words.back() = 60000; }},
        Broken{"keyframe_count_zero", [](ModelData& d) { d.keyframe_counts[0] = 0; }},
        Broken{"keyframe_offsets", [](ModelData& d) { d.keyframe_word_begin[1] = 1000000; }},
        Broken{"plan_is_no_picture", [](ModelData& d) { d.floor_plan.picture[0] = 0; }},
        Broken{"plan_too_large",
               [](ModelData& d) { d.floor_plan.picture.resize(kMaxFloorPlanBytes + 1); }},
        Broken{"plan_without_size", [](ModelData& d) { d.floor_plan.width = 0; }},
        Broken{"plan_alignment_nan",
               [](ModelData& d) { d.floor_plan.site_from_pixel[2] = double{kNan}; }},
        Broken{"plan_without_scale",
               [](ModelData& d) { d.floor_plan.site_from_pixel = {0, 0, 1, 1}; }},
        Broken{"map_metric_short", [](ModelData& d) { d.map_metric.pop_back(); }},
        Broken{"rarity_short", [](ModelData& d) { d.landmark_rarity.pop_back(); }},
        Broken{"map_step_zero", [](ModelData& d) { d.map_step[0] = 0; }},
        Broken{"pose_missing", [](ModelData& d) { d.keyframe_pose.pop_back(); }},
        Broken{"pose_nan", [](ModelData& d) { d.keyframe_pose[0][0] = kNan; }},
        Broken{"pose_not_unit", [](ModelData& d) { d.keyframe_pose[0][3] = 2; }}),
    [](const auto& param) { return param.param.name; });

class BrokenMap : public ::testing::TestWithParam<Broken> {};

TEST_P(BrokenMap, IsRefused) {
  ModelData data = MappedModelData();
  ASSERT_TRUE(WriteModel(data).ok());
  GetParam().break_it(data);
  EXPECT_FALSE(WriteModel(data).ok());
}

constexpr float kInfinity = std::numeric_limits<float>::infinity();

INSTANTIATE_TEST_SUITE_P(
    Semantics, BrokenMap,
    ::testing::Values(
        Broken{"camera_model_zero", [](ModelData& d) { d.camera.model = 0; }},
        Broken{"camera_model_unknown", [](ModelData& d) { d.camera.model = 4; }},
        Broken{"camera_without_width", [](ModelData& d) { d.camera.width = 0; }},
        Broken{"camera_without_height", [](ModelData& d) { d.camera.height = 0; }},
        Broken{"focal_length_zero", [](ModelData& d) { d.camera.intrinsics[0] = 0; }},
        Broken{"focal_length_negative", [](ModelData& d) { d.camera.intrinsics[1] = -1; }},
        Broken{"centre_nan", [](ModelData& d) { d.camera.intrinsics[2] = double{kNan}; }},
        Broken{"centre_infinite", [](ModelData& d) { d.camera.intrinsics[3] = double{kInfinity}; }},
        Broken{"distortion_nan", [](ModelData& d) { d.camera.distortion[7] = double{kNan}; }},
        Broken{"maps_do_not_begin_at_zero", [](ModelData& d) { d.map_begin[0] = 1; }},
        Broken{"maps_go_back", [](ModelData& d) { d.map_begin[1] = 11; }},
        Broken{"maps_end_early", [](ModelData& d) { d.map_begin[2] = 9; }},
        Broken{"maps_end_late", [](ModelData& d) { d.map_begin[2] = 11; }},
        Broken{"no_map_begin", [](ModelData& d) { d.map_begin.clear(); }},
        Broken{"one_map_too_many", [](ModelData& d) { d.map_begin.push_back(10); }},
        Broken{"origin_missing", [](ModelData& d) { d.map_origin.pop_back(); }},
        Broken{"origin_nan", [](ModelData& d) { d.map_origin[1][2] = kNan; }},
        Broken{"step_missing", [](ModelData& d) { d.map_step.pop_back(); }},
        Broken{"no_maps",
               [](ModelData& d) { d.map_step.clear(), d.map_origin.clear(), d.map_begin = {0}; }},
        Broken{"step_zero", [](ModelData& d) { d.map_step[0] = 0; }},
        Broken{"step_negative", [](ModelData& d) { d.map_step[1] = -1; }},
        Broken{"step_nan", [](ModelData& d) { d.map_step[1] = kNan; }},
        Broken{"step_infinite", [](ModelData& d) { d.map_step[0] = kInfinity; }},
        Broken{"position_missing", [](ModelData& d) { d.landmark_position.pop_back(); }},
        Broken{"no_positions", [](ModelData& d) { d.landmark_position.clear(); }},
        Broken{"descriptors_short", [](ModelData& d) { d.landmark_descriptors.pop_back(); }},
        Broken{"descriptors_long", [](ModelData& d) { d.landmark_descriptors.push_back(0); }},
        Broken{"chroma_short", [](ModelData& d) { d.landmark_chroma.resize(72); }},
        Broken{"chroma_of_no_whole_rows", [](ModelData& d) { d.landmark_chroma.pop_back(); }},
        Broken{"sign_missing", [](ModelData& d) { d.landmark_laplacian_sign.pop_back(); }},
        Broken{"sign_two", [](ModelData& d) { d.landmark_laplacian_sign[3] = 2; }},
        Broken{"sign_minus_two", [](ModelData& d) { d.landmark_laplacian_sign[3] = -2; }},
        Broken{"rarity_missing", [](ModelData& d) { d.landmark_rarity.pop_back(); }},
        Broken{"map_metric_missing", [](ModelData& d) { d.map_metric.pop_back(); }},
        Broken{"map_metric_two", [](ModelData& d) { d.map_metric[1] = 2; }},
        Broken{"sigma_zero", [](ModelData& d) { d.pixel_sigma = 0; }},
        Broken{"sigma_negative", [](ModelData& d) { d.pixel_sigma = -1; }},
        Broken{"sigma_nan", [](ModelData& d) { d.pixel_sigma = kNan; }},
        Broken{"sigma_infinite", [](ModelData& d) { d.pixel_sigma = kInfinity; }},
        Broken{
            "keyframes_without_landmark_table",
            [](ModelData& d) { d.keyframe_landmark_begin.clear(), d.keyframe_landmarks.clear(); }},
        Broken{"keyframe_landmarks_begin_late",
               [](ModelData& d) { d.keyframe_landmark_begin[0] = 1; }},
        Broken{"keyframe_landmarks_go_back",
               [](ModelData& d) { d.keyframe_landmark_begin[1] = 9; }},
        Broken{"keyframe_landmarks_beyond_the_end",
               [](ModelData& d) { d.keyframe_landmark_begin[5] = 1000000; }},
        Broken{"keyframe_landmarks_end_early",
               [](ModelData& d) { d.keyframe_landmark_begin.back() = 11; }},
        Broken{"keyframe_landmark_table_short",
               [](ModelData& d) { d.keyframe_landmark_begin.pop_back(); }},
        Broken{"keyframe_landmark_unknown", [](ModelData& d) { d.keyframe_landmarks.back() = 10; }},
        Broken{"keyframe_landmark_twice", [](ModelData& d) { d.keyframe_landmarks[1] = 0; }},
        Broken{"keyframe_landmarks_descend",
               [](ModelData& d) { std::swap(d.keyframe_landmarks[0], d.keyframe_landmarks[1]); }},
        Broken{"keyframe_of_two_maps", [](ModelData& d) { d.keyframe_landmarks[3] = 6; }},
        Broken{"keyframe_sees_without_pose",
               [](ModelData& d) { d.keyframe_landmark_begin[2] = 5; }},
        Broken{"keyframe_lost_its_pose", [](ModelData& d) { d.keyframe_has_pose[0] = 0; }}),
    [](const auto& param) { return param.param.name; });

class BrokenDetails : public ::testing::TestWithParam<Broken> {};

TEST_P(BrokenDetails, AreRefused) {
  ModelData data = TinyModelData();
  AddTinyDetails(data);
  ASSERT_TRUE(WriteModel(data).ok());
  GetParam().break_it(data);
  EXPECT_FALSE(WriteModel(data).ok());
}

INSTANTIATE_TEST_SUITE_P(
    Semantics, BrokenDetails,
    ::testing::Values(
        Broken{"no_parts", [](ModelData& d) { d.details.parts = 0; }},
        Broken{"parts_do_not_divide", [](ModelData& d) { d.details.parts = 3; }},
        Broken{"codebook_short", [](ModelData& d) { d.details.codebook.pop_back(); }},
        Broken{"no_codebook", [](ModelData& d) { d.details.codebook.clear(); }},
        Broken{"no_rotation", [](ModelData& d) { d.details.rotation.clear(); }},
        Broken{"rotation_short", [](ModelData& d) { d.details.rotation.pop_back(); }},
        Broken{"rotation_of_fewer_directions",
               [](ModelData& d) {
                 d.details.rotation.resize(d.details.rotation.size() -
                                           std::size_t{8} * d.features.descriptor_dim);
               }},
        Broken{"rotation_of_more_directions",
               [](ModelData& d) {
                 d.details.rotation.resize(std::size_t{72} * d.features.descriptor_dim);
                 d.details.codebook.resize(std::size_t{72} * kCodesOfPart);
               }},
        Broken{"no_lists", [](ModelData& d) { d.details.list_size.clear(); }},
        Broken{"list_missing", [](ModelData& d) { d.details.list_size.pop_back(); }},
        Broken{"list_too_long", [](ModelData& d) { d.details.list_size[1] = 255; }},
        Broken{"list_too_short", [](ModelData& d) { d.details.list_size[1] = 0; }},
        Broken{"likeness_negative", [](ModelData& d) { d.details.likeness_weight = -1; }},
        Broken{"likeness_nan", [](ModelData& d) { d.details.likeness_weight = kNan; }},
        Broken{"close_weight_negative", [](ModelData& d) { d.details.close_weight = -1; }},
        Broken{"close_weight_nan", [](ModelData& d) { d.details.close_weight = kNan; }},
        Broken{"codes_short", [](ModelData& d) { d.details.codes.pop_back(); }},
        Broken{"codes_of_nothing", [](ModelData& d) { d.details.codes.push_back(0); }}),
    [](const auto& param) { return param.param.name; });

TEST(ModelView, DetailsMayLeaveDirectionsOut) {
  ModelData data = TinyModelData();
  AddTinyDetails(data);
  ASSERT_EQ(data.features.descriptor_dim, 64);
  data.details.rotation.resize(std::size_t{56} * 64);
  data.details.codebook.resize(std::size_t{56} * kCodesOfPart);
  EXPECT_TRUE(WriteModel(data).ok());
}

TEST(ModelView, LandmarksOfKeyframesWithoutAMapAreRefused) {
  ModelData data = TinyModelData();
  data.keyframe_landmark_begin.assign(data.keyframe_pair.size() + 1, 0);
  EXPECT_FALSE(WriteModel(data).ok());
}

}  // namespace
}  // namespace viewfix
