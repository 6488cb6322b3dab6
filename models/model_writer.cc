// SPDX-License-Identifier: BSD-3-Clause
#include "models/model_writer.h"

#include <algorithm>
#include <cstring>

#include "models/viewfix_generated.h"

namespace viewfix {
namespace {

// Everything is written, defaults too: a reader then sees each stated value.
flatbuffers::Offset<fb::Model> BuildModel(flatbuffers::FlatBufferBuilder& b, const ModelData& d) {
  const ModelFeatures& f = d.features;
  const int dim = std::max(1, f.descriptor_dim);
  const auto features =
      fb::CreateFeatures(b, f.type, f.version, static_cast<std::uint16_t>(f.max_image_side),
                         static_cast<std::uint16_t>(f.max_features), f.upright, f.threshold,
                         static_cast<std::uint16_t>(f.descriptor_dim));
  const auto vocabulary = fb::CreateVocabulary(
      b, static_cast<std::uint32_t>(d.words.size() / dim),
      static_cast<std::uint16_t>(f.descriptor_dim), b.CreateVector(d.words),
      static_cast<std::uint8_t>(d.words_per_feature));
  const auto locations = b.CreateVectorOfStrings(d.locations);
  const auto views = b.CreateVectorOfStrings(d.views);
  const auto pair_location = b.CreateVector(d.pair_location);
  const auto pair_view = b.CreateVector(d.pair_view);
  const auto bias = b.CreateVector(d.bias);
  const auto weight_scale = b.CreateVector(d.weight_scale);
  const auto weights = b.CreateVector(d.weights);
  const auto scoring =
      fb::CreateScoring(b, static_cast<std::uint8_t>(d.histogram_map),
                        static_cast<std::uint8_t>(d.location_rule), locations, views,
                        pair_location, pair_view, bias, weight_scale, weights, d.keyframe_weight);
  const auto confidence =
      fb::CreateConfidence(b, d.confidence.offset, d.confidence.slope, d.confidence.threshold);
  std::vector<float> poses;
  for (const auto& pose : d.keyframe_pose) poses.insert(poses.end(), pose.begin(), pose.end());
  const auto pair = b.CreateVector(d.keyframe_pair);
  const auto word_begin = b.CreateVector(d.keyframe_word_begin);
  const auto words = b.CreateVector(d.keyframe_words);
  const auto counts = b.CreateVector(d.keyframe_counts);
  const auto has_pose = b.CreateVector(d.keyframe_has_pose);
  const auto pose = b.CreateVector(poses);
  const auto keyframes = fb::CreateKeyframes(b, pair, word_begin, words, counts, has_pose, pose);
  return fb::CreateModel(b, features, vocabulary, scoring, confidence, keyframes, d.metric,
                         b.CreateString(d.record));
}

template <typename T>
void PutLittleEndian(std::uint8_t* to, T value) {
  std::memcpy(to, &value, sizeof value);
}

}  // namespace

Result<std::vector<std::uint8_t>> WriteModel(const ModelData& data) {
  flatbuffers::FlatBufferBuilder builder(1 << 20);
  builder.ForceDefaults(true);
  fb::FinishModelBuffer(builder, BuildModel(builder, data));
  std::vector<std::uint8_t> file(kModelHeaderBytes + builder.GetSize(), 0);
  std::copy(kModelMagic.begin(), kModelMagic.end(), file.begin());
  PutLittleEndian(&file[8], kModelFormatVersion);
  PutLittleEndian(&file[12], static_cast<std::uint32_t>(kModelHeaderBytes));
  PutLittleEndian(&file[16], std::uint64_t{builder.GetSize()});
  std::copy_n(builder.GetBufferPointer(), builder.GetSize(), file.begin() + kModelHeaderBytes);
  const auto hash = HashModel(file);
  std::copy(hash.begin(), hash.end(), file.begin() + kModelHashOffset);
  if (Result<ModelView> view = ModelView::Open(file); !view.ok()) return view.status();
  return file;
}

}  // namespace viewfix
