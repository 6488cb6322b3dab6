// SPDX-License-Identifier: BSD-3-Clause
#include "models/model_writer.h"

#include <algorithm>
#include <cstring>

#include "models/viewfix_generated.h"

namespace viewfix {
namespace {

template <typename T, std::size_t N>
std::vector<T> Flat(const std::vector<std::array<T, N>>& rows) {
  std::vector<T> flat;
  for (const auto& row : rows) flat.insert(flat.end(), row.begin(), row.end());
  return flat;
}

flatbuffers::Offset<fb::Camera> BuildCamera(flatbuffers::FlatBufferBuilder& b,
                                            const ModelData::CameraData& c) {
  const auto intrinsics = b.CreateVector(c.intrinsics.data(), c.intrinsics.size());
  const auto distortion = b.CreateVector(c.distortion.data(), c.distortion.size());
  return fb::CreateCamera(b, c.model, static_cast<std::uint16_t>(c.width),
                          static_cast<std::uint16_t>(c.height), intrinsics, distortion);
}

flatbuffers::Offset<fb::Landmarks> BuildLandmarks(flatbuffers::FlatBufferBuilder& b,
                                                  const ModelData& d) {
  const auto map_begin = b.CreateVector(d.map_begin);
  const auto map_origin = b.CreateVector(Flat(d.map_origin));
  const auto map_step = b.CreateVector(d.map_step);
  const auto position = b.CreateVector(Flat(d.landmark_position));
  const auto descriptors = b.CreateVector(d.landmark_descriptors);
  const auto sign = b.CreateVector(d.landmark_laplacian_sign);
  const auto rarity = b.CreateVector(d.landmark_rarity);
  const auto map_metric = b.CreateVector(d.map_metric);
  return fb::CreateLandmarks(b, map_begin, map_origin, map_step, position, descriptors, sign,
                             rarity, d.pixel_sigma, map_metric);
}

flatbuffers::Offset<fb::FloorPlan> BuildFloorPlan(flatbuffers::FlatBufferBuilder& b,
                                                  const ModelData::FloorPlanData& f) {
  if (f.picture.empty()) return 0;
  const auto picture = b.CreateVector(f.picture);
  const auto alignment = b.CreateVector(f.site_from_pixel.data(), f.site_from_pixel.size());
  return fb::CreateFloorPlan(b, picture, static_cast<std::uint16_t>(f.width),
                             static_cast<std::uint16_t>(f.height), alignment);
}

// Of each keyframe, words that ascend and that occur.
bool HasHistograms(const ModelData& d) {
  const std::vector<std::uint32_t>& begin = d.keyframe_word_begin;
  if (begin.empty() || begin.front() != 0 || begin.back() != d.keyframe_words.size() ||
      d.keyframe_counts.size() != d.keyframe_words.size() ||
      !std::is_sorted(begin.begin(), begin.end())) {
    return false;
  }
  for (std::size_t k = 0; k + 1 < begin.size(); ++k) {
    for (std::uint32_t j = begin[k]; j < begin[k + 1]; ++j) {
      if (d.keyframe_counts[j] == 0) return false;
      if (j > begin[k] && d.keyframe_words[j] <= d.keyframe_words[j - 1]) return false;
    }
  }
  return true;
}

// Of each word, one weight a pair.
bool HasWeights(const ModelData& d) {
  const auto fits = [](std::int8_t weight) {
    return weight >= -kWeightBias && weight < kWeightBias;
  };
  return !d.pair_location.empty() && d.weights.size() % d.pair_location.size() == 0 &&
         std::ranges::all_of(d.weights, fits);
}

// As viewfix.fbs says it.
std::vector<std::uint8_t> PackWeights(const ModelData& d) {
  const std::size_t pairs = d.pair_location.size();
  std::vector<std::uint8_t> packed;
  for (std::size_t begin = 0; begin < d.weights.size(); begin += pairs) {
    for (std::size_t p = 0; p < pairs; p += 2) {
      const int even = d.weights[begin + p] + kWeightBias;
      const int odd = p + 1 < pairs ? d.weights[begin + p + 1] + kWeightBias : 0;
      packed.push_back(static_cast<std::uint8_t>(even + odd * 16));
    }
  }
  return packed;
}

struct CodedWords {
  std::vector<std::uint32_t> begin = {0};
  std::vector<std::uint8_t> entries;
};

// As viewfix.fbs says it.
CodedWords CodeKeyframeWords(const ModelData& d) {
  CodedWords coded;
  const auto add = [&](int step, int count) {
    coded.entries.push_back(static_cast<std::uint8_t>((step - 1) * 8 + count));
  };
  for (std::size_t k = 0; k + 1 < d.keyframe_word_begin.size(); ++k) {
    int word = -1;
    for (std::uint32_t j = d.keyframe_word_begin[k]; j < d.keyframe_word_begin[k + 1]; ++j) {
      for (; d.keyframe_words[j] - word > kMaxKeyframeStep; word += kMaxKeyframeStep) {
        add(kMaxKeyframeStep, 0);
      }
      add(d.keyframe_words[j] - word, std::min<int>(d.keyframe_counts[j], kMaxKeyframeCount));
      word = d.keyframe_words[j];
    }
    coded.begin.push_back(static_cast<std::uint32_t>(coded.entries.size()));
  }
  return coded;
}

flatbuffers::Offset<fb::Details> BuildDetails(flatbuffers::FlatBufferBuilder& b,
                                              const ModelData::DetailsData& d) {
  if (d.codes.empty()) return 0;
  const auto rotation = b.CreateVector(d.rotation);
  const auto codebook = b.CreateVector(d.codebook);
  const auto list_size = b.CreateVector(d.list_size);
  const auto codes = b.CreateVector(d.codes);
  return fb::CreateDetails(b, static_cast<std::uint8_t>(d.parts), rotation, codebook, list_size,
                           codes, d.likeness_weight, d.close_weight);
}

flatbuffers::Offset<fb::GoldenQueries> BuildGolden(flatbuffers::FlatBufferBuilder& b,
                                                   const ModelData::GoldenData& g) {
  if (g.pair.empty()) return 0;
  const auto width = b.CreateVector(g.width);
  const auto height = b.CreateVector(g.height);
  const auto begin = b.CreateVector(g.begin);
  const auto keypoints = b.CreateVector(g.keypoints);
  const auto sign = b.CreateVector(g.laplacian_sign);
  const auto descriptors = b.CreateVector(g.descriptors);
  const auto pair = b.CreateVector(g.pair);
  const auto has_pose = b.CreateVector(g.has_pose);
  const auto pose = b.CreateVector(Flat(g.pose));
  return fb::CreateGoldenQueries(b, width, height, begin, keypoints, sign, descriptors, pair,
                                 has_pose, pose);
}

// Everything is written, defaults too: a reader then sees each stated value.
flatbuffers::Offset<fb::Model> BuildModel(flatbuffers::FlatBufferBuilder& b, const ModelData& d) {
  const ModelFeatures& f = d.features;
  const int dim = std::max(1, f.descriptor_dim);
  const auto features =
      fb::CreateFeatures(b, f.type, f.version, static_cast<std::uint16_t>(f.max_image_side),
                         static_cast<std::uint16_t>(f.max_features), f.upright, f.threshold,
                         static_cast<std::uint16_t>(f.descriptor_dim));
  const auto vocabulary =
      fb::CreateVocabulary(b, static_cast<std::uint32_t>(d.words.size() / dim),
                           static_cast<std::uint16_t>(f.descriptor_dim), b.CreateVector(d.words),
                           static_cast<std::uint8_t>(d.words_per_feature));
  const auto locations = b.CreateVectorOfStrings(d.locations);
  const auto views = b.CreateVectorOfStrings(d.views);
  const auto pair_location = b.CreateVector(d.pair_location);
  const auto pair_view = b.CreateVector(d.pair_view);
  const auto bias = b.CreateVector(d.bias);
  const auto weight_scale = b.CreateVector(d.weight_scale);
  const auto weights = b.CreateVector(PackWeights(d));
  const auto scoring = fb::CreateScoring(
      b, static_cast<std::uint8_t>(d.histogram_map), static_cast<std::uint8_t>(d.location_rule),
      locations, views, pair_location, pair_view, bias, weight_scale, weights, d.keyframe_weight);
  const auto confidence =
      fb::CreateConfidence(b, d.confidence.offset, d.confidence.slope, d.confidence.threshold);
  const auto pair = b.CreateVector(d.keyframe_pair);
  const CodedWords coded = CodeKeyframeWords(d);
  const auto word_begin = b.CreateVector(coded.begin);
  const auto words = b.CreateVector(coded.entries);
  const auto has_pose = b.CreateVector(d.keyframe_has_pose);
  const auto pose = b.CreateVector(Flat(d.keyframe_pose));
  const auto landmark_begin = b.CreateVector(d.keyframe_landmark_begin);
  const auto landmarks = b.CreateVector(d.keyframe_landmarks);
  flatbuffers::Offset<flatbuffers::Vector<flatbuffers::Offset<flatbuffers::String>>> names = 0;
  if (!d.keyframe_names.empty()) names = b.CreateVectorOfStrings(d.keyframe_names);
  const auto keyframes = fb::CreateKeyframes(b, pair, word_begin, words, has_pose, pose,
                                             landmark_begin, landmarks, names);
  flatbuffers::Offset<fb::Camera> camera = 0;
  flatbuffers::Offset<fb::Landmarks> map = 0;
  if (!d.landmark_position.empty()) {
    camera = BuildCamera(b, d.camera);
    map = BuildLandmarks(b, d);
  }
  const auto details = BuildDetails(b, d.details);
  const auto golden = BuildGolden(b, d.golden);
  flatbuffers::Offset<fb::PoseConfidence> pose_confidence = 0;
  if (d.pose_confidence) {
    const ModelPoseConfidence& c = *d.pose_confidence;
    pose_confidence = fb::CreatePoseConfidence(
        b, c.offset, b.CreateVector(c.weights.data(), c.weights.size()), c.threshold);
  }
  return fb::CreateModel(b, features, vocabulary, scoring, confidence, keyframes, d.metric, camera,
                         map, b.CreateString(d.record), BuildFloorPlan(b, d.floor_plan), details,
                         golden, pose_confidence);
}

template <typename T>
std::vector<T> Owned(std::span<const T> values) {
  return {values.begin(), values.end()};
}

template <std::size_t N, typename T>
std::vector<std::array<T, N>> Rows(std::span<const T> flat) {
  std::vector<std::array<T, N>> rows(flat.size() / N);
  for (std::size_t i = 0; i < rows.size(); ++i) std::copy_n(&flat[i * N], N, rows[i].begin());
  return rows;
}

void UnpackScoring(const ModelView& m, ModelData& d) {
  const ModelScoring& s = m.scoring();
  d.histogram_map = s.histogram_map;
  d.location_rule = s.location_rule;
  for (int i = 0; i < s.num_locations; ++i) d.locations.emplace_back(m.location_name(i));
  for (int i = 0; i < s.num_views; ++i) d.views.emplace_back(m.view_name(i));
  d.pair_location = Owned(s.pair_location);
  d.pair_view = Owned(s.pair_view);
  d.bias = Owned(s.bias);
  d.weight_scale = Owned(s.weight_scale);
  const std::size_t row = PackedWeights(s.num_pairs);
  for (std::size_t begin = 0; begin < s.weights.size(); begin += row) {
    for (int p = 0; p < s.num_pairs; ++p) {
      d.weights.push_back(static_cast<std::int8_t>(WeightOf(s.weights.subspan(begin, row), p)));
    }
  }
  d.keyframe_weight = s.keyframe_weight;
}

void UnpackKeyframes(const ModelView& m, ModelData& d) {
  const ModelKeyframes& k = m.keyframes();
  d.keyframe_pair = Owned(k.pair);
  for (int i = 0; i < k.size; ++i) {
    int word = -1;
    for (std::uint32_t j = k.word_begin[i]; j < k.word_begin[std::size_t(i) + 1]; ++j) {
      word += StepOf(k.words[j]);
      if (CountOf(k.words[j]) == 0) continue;
      d.keyframe_words.push_back(static_cast<std::uint16_t>(word));
      d.keyframe_counts.push_back(static_cast<std::uint8_t>(CountOf(k.words[j])));
    }
    d.keyframe_word_begin.push_back(static_cast<std::uint32_t>(d.keyframe_words.size()));
  }
  d.keyframe_has_pose = Owned(k.has_pose);
  d.keyframe_pose = Rows<7>(k.pose);
  d.keyframe_landmark_begin = Owned(k.landmark_begin);
  d.keyframe_landmarks = Owned(k.landmarks);
  const bool has_names = k.size > 0 && !m.keyframe_name(0).empty();
  for (int i = 0; has_names && i < k.size; ++i) d.keyframe_names.emplace_back(m.keyframe_name(i));
}

void UnpackMaps(const ModelView& m, ModelData& d) {
  d.metric = m.metric();
  if (!m.has_landmarks()) return;
  const ModelCamera& c = m.camera();
  d.camera = {c.model, c.width, c.height, {}, {}};
  std::copy(c.intrinsics.begin(), c.intrinsics.end(), d.camera.intrinsics.begin());
  std::copy(c.distortion.begin(), c.distortion.end(), d.camera.distortion.begin());
  const ModelLandmarks& l = m.landmarks();
  d.map_begin = Owned(l.map_begin);
  d.map_origin = Rows<3>(l.map_origin);
  d.map_step = Owned(l.map_step);
  d.map_metric = Owned(l.map_metric);
  d.landmark_position = Rows<3>(l.position);
  d.landmark_descriptors = Owned(l.descriptors);
  d.landmark_laplacian_sign = Owned(l.laplacian_sign);
  d.landmark_rarity = Owned(l.rarity);
  d.pixel_sigma = l.pixel_sigma;
}

void UnpackExtras(const ModelView& m, ModelData& d) {
  if (m.has_floor_plan()) {
    const ModelFloorPlan& f = m.floor_plan();
    d.floor_plan = {Owned(f.picture), f.width, f.height, {}};
    std::copy(f.site_from_pixel.begin(), f.site_from_pixel.end(),
              d.floor_plan.site_from_pixel.begin());
  }
  if (m.has_details()) {
    const ModelDetails& t = m.details();
    d.details = {t.parts,        Owned(t.rotation), Owned(t.codebook), Owned(t.list_size),
                 Owned(t.codes), t.likeness_weight, t.close_weight};
  }
  const ModelGolden& g = m.golden();
  if (g.size == 0) return;
  d.golden = {Owned(g.width),     Owned(g.height),         Owned(g.begin),
              Owned(g.keypoints), Owned(g.laplacian_sign), Owned(g.descriptors),
              Owned(g.pair),      Owned(g.has_pose),       Rows<7>(g.pose)};
}

template <typename T>
void PutLittleEndian(std::uint8_t* to, T value) {
  std::memcpy(to, &value, sizeof value);
}

}  // namespace

Result<std::vector<std::uint8_t>> WriteModel(const ModelData& data) {
  if (!HasHistograms(data)) {
    return Status(StatusCode::kInvalidArgument, "a keyframe's words do not ascend or occur");
  }
  if (!HasWeights(data)) {
    return Status(StatusCode::kInvalidArgument, "a weight for each pair and word, -8..7");
  }
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

ModelData UnpackModel(const ModelView& model) {
  ModelData data;
  data.features = model.features();
  data.words = Owned(model.vocabulary().words);
  data.words_per_feature = model.vocabulary().words_per_feature;
  data.confidence = model.confidence();
  data.pose_confidence = model.pose_confidence();
  UnpackScoring(model, data);
  UnpackKeyframes(model, data);
  UnpackMaps(model, data);
  UnpackExtras(model, data);
  data.record = model.record();
  return data;
}

}  // namespace viewfix
