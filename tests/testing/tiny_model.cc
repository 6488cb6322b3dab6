// SPDX-License-Identifier: BSD-3-Clause
#include "tests/testing/tiny_model.h"

#include <cstdio>
#include <cstdlib>
#include <random>
#include <utility>

#include "engine/features/chroma_contrast.h"
#include "engine/features/feature_extractor.h"
#include "engine/features/surf_descriptor.h"

namespace viewfix {
namespace {

constexpr int kWords = 32;
constexpr int kPairs = 4;

template <typename T>
T OrEnd(Result<T> result) {
  if (result.ok()) return std::move(*result);
  std::fprintf(stderr, "tiny model: %s\n", result.status().text());
  std::abort();
}

void FillFeatures(ModelFeatures& features) {
  FeatureOptions options;
  options.max_image_side = 320;
  options.max_features = 200;
  const auto extractor = OrEnd(CreateFeatureExtractor(options));
  features.type = static_cast<std::uint8_t>(options.type);
  features.version = extractor->version();
  features.max_image_side = options.max_image_side;
  features.max_features = options.max_features;
  features.upright = options.upright;
  features.threshold = options.threshold;
  features.descriptor_dim = extractor->descriptor_dim();
}

void FillKeyframes(ModelData& data) {
  for (int k = 0; k < 2 * kPairs; ++k) {
    data.keyframe_pair.push_back(static_cast<std::uint16_t>(k / 2));
    for (int word = k; word < kWords; word += 4) {
      data.keyframe_words.push_back(static_cast<std::uint16_t>(word));
      data.keyframe_counts.push_back(static_cast<std::uint8_t>(1 + (word + k) % 3));
    }
    data.keyframe_word_begin.push_back(static_cast<std::uint32_t>(data.keyframe_words.size()));
    const bool has_pose = k % 2 == 0;
    data.keyframe_has_pose.push_back(has_pose ? 1 : 0);
    const float x = 0.1F * static_cast<float>(k);
    data.keyframe_pose.push_back(has_pose ? std::array<float, 7>{x, -1.5F, 2, 0, 0.6F, 0, 0.8F}
                                          : std::array<float, 7>{});
  }
}

}  // namespace

ModelData TinyModelData() {
  ModelData data;
  FillFeatures(data.features);
  std::mt19937 random(1);
  const auto byte = [&] { return static_cast<std::int8_t>(static_cast<int>(random() % 61) - 30); };
  data.words.resize(std::size_t{kWords} * data.features.descriptor_dim);
  for (std::int8_t& value : data.words) value = byte();
  data.locations = {"floor1/caf\xC3\xA9", "floor1/lobby"};
  data.views = {"left", "right"};
  data.pair_location = {0, 0, 1, 1};
  data.pair_view = {0, 1, 0, 1};
  data.bias.assign(kPairs, 0.125F);
  data.weight_scale.assign(kPairs, 1.0F / 16);
  data.weights.resize(std::size_t{kWords} * kPairs);
  for (std::int8_t& value : data.weights) value = static_cast<std::int8_t>(random() % 15) - 7;
  data.confidence = {.offset = 0, .slope = 2, .threshold = 0};
  FillKeyframes(data);
  data.metric = true;
  data.record = "{}";
  return data;
}

void AddTinyMaps(ModelData& data) {
  constexpr int kLandmarks = 40;
  std::mt19937 random(2);
  const auto within = [&](int limit) {
    return static_cast<int>(random() % (2 * limit + 1)) - limit;
  };
  data.camera = {1, 320, 240, {300, 300, 159.5, 119.5}, {}};
  data.map_begin = {0, kLandmarks / 2, kLandmarks};
  data.map_origin = {{3, -1.5F, 3}, {3.5F, -1.5F, 3}};
  data.map_step = {0.001F, 0.001F};
  data.map_metric = {1, 0};
  for (int l = 0; l < kLandmarks; ++l) {
    data.landmark_position.push_back({static_cast<std::int16_t>(within(300)),
                                      static_cast<std::int16_t>(within(300)),
                                      static_cast<std::int16_t>(within(300))});
    data.landmark_laplacian_sign.push_back(l % 2 == 0 ? 1 : -1);
    data.landmark_rarity.push_back(static_cast<std::uint8_t>(255 / (1 + l % 3)));
    for (int d = 0; d < data.features.descriptor_dim; ++d) {
      data.landmark_descriptors.push_back(static_cast<std::int8_t>(within(30)));
    }
  }
  data.keyframe_landmark_begin = {0};
  for (std::uint32_t k = 0; k < data.keyframe_has_pose.size(); ++k) {
    const std::uint32_t first = k < 4 ? 0 : kLandmarks / 2;
    for (std::uint32_t l = first; data.keyframe_has_pose[k] != 0 && l < first + 15 + k; ++l) {
      if (l < first + kLandmarks / 2) data.keyframe_landmarks.push_back(l);
    }
    data.keyframe_landmark_begin.push_back(
        static_cast<std::uint32_t>(data.keyframe_landmarks.size()));
  }
}

void AddTinyFloorPlan(ModelData& data) {
  data.floor_plan.picture = {0x89, 'P', 'N', 'G', 0x0D, 0x0A, 0x1A, 0x0A, 0, 0};
  data.floor_plan.width = 20;
  data.floor_plan.height = 10;
  data.floor_plan.site_from_pixel = {0.5, 0.25, -3, 7};
}

void AddTinyDetails(ModelData& data) {
  std::mt19937 random(4);
  data.details.parts = 8;
  data.details.codebook.resize(std::size_t{kCodesOfPart} * data.features.descriptor_dim);
  for (std::int8_t& value : data.details.codebook) {
    value = static_cast<std::int8_t>(static_cast<int>(random() % 41) - 20);
  }
  data.details.rotation = NoRotation(data.features.descriptor_dim);
  data.details.list_size.assign(std::size_t{3} * 2 * kWords, 1);
  data.details.codes.resize(data.details.list_size.size() * 8);
  for (std::uint8_t& code : data.details.codes) code = static_cast<std::uint8_t>(random());
  data.details.likeness_weight = 1.5F;
  data.details.close_weight = 2;
}

ModelData ColourModelData() {
  ModelData data = TinyModelData();
  std::vector<std::int8_t> words;
  for (auto word = data.words.begin(); word != data.words.end(); word += kSurfDim) {
    words.insert(words.end(), word, word + kSurfDim);
    words.insert(words.end(), kChromaDim, 0);
  }
  data.words = std::move(words);
  data.features.type = static_cast<std::uint8_t>(FeatureType::kColorSurf);
  data.features.descriptor_dim = kSurfDim + kChromaDim;
  return data;
}

std::vector<std::int8_t> NoRotation(int dim) {
  std::vector<std::int8_t> rotation(std::size_t(dim) * dim, 0);
  for (int i = 0; i < dim; ++i) rotation[std::size_t(i) * dim + i] = 127;
  return rotation;
}

std::vector<std::uint8_t> TinyModel() { return OrEnd(WriteModel(TinyModelData())); }

}  // namespace viewfix
