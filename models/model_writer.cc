// SPDX-License-Identifier: BSD-3-Clause
#include "models/model_writer.h"

#include <algorithm>
#include <cassert>
#include <cstring>

#include "models/huffman_decoder.h"
#include "models/huffman_encoder.h"
#include "models/viewfix_generated.h"

namespace viewfix {
namespace {

template <typename T, std::size_t N>
std::vector<T> Flat(const std::vector<std::array<T, N>>& rows) {
  std::vector<T> flat;
  for (const auto& row : rows) flat.insert(flat.end(), row.begin(), row.end());
  return flat;
}

// Rows of one length.
template <typename T>
ByteRows RowsOf(std::span<const T> bytes, std::size_t length) {
  assert(length > 0 && bytes.size() % length == 0);
  ByteRows rows;
  for (std::size_t begin = 0; begin < bytes.size(); begin += length) {
    const auto row = bytes.subspan(begin, length);
    rows.emplace_back(reinterpret_cast<const std::uint8_t*>(row.data()), row.size());
  }
  return rows;
}

ByteRows RowsOf(const std::vector<std::vector<std::uint8_t>>& rows) {
  return {rows.begin(), rows.end()};
}

// By the tables given, which keep the bytes of rows that have not changed, or by others.
EncodedRows Encode(const std::vector<std::uint8_t>& tables, const ByteRows& rows,
                   std::span<const int> columns) {
  return tables.empty() ? EncodeRows(rows, columns) : EncodeRowsBy(tables, rows);
}

flatbuffers::Offset<fb::EncodedRows> BuildRows(flatbuffers::FlatBufferBuilder& b,
                                               const EncodedRows& encoded) {
  const auto tables = b.CreateVector(encoded.tables);
  const auto rows = b.CreateVector(encoded.rows);
  return fb::CreateEncodedRows(b, tables, rows);
}

constexpr int kOneColumn[] = {1};

// Of SURF's numbers each fourth is of a kind.
flatbuffers::Offset<fb::EncodedRows> BuildDescriptors(flatbuffers::FlatBufferBuilder& b,
                                                      const std::vector<std::uint8_t>& tables,
                                                      const std::vector<std::int8_t>& descriptors,
                                                      int dim) {
  const int columns[] = {1, 4, dim};
  return BuildRows(b, Encode(tables, RowsOf(std::span(descriptors), dim), columns));
}

flatbuffers::Offset<fb::Camera> BuildCamera(flatbuffers::FlatBufferBuilder& b,
                                            const ModelData::CameraData& c) {
  const auto intrinsics = b.CreateVector(c.intrinsics.data(), c.intrinsics.size());
  const auto distortion = b.CreateVector(c.distortion.data(), c.distortion.size());
  return fb::CreateCamera(b, c.model, static_cast<std::uint16_t>(c.width),
                          static_cast<std::uint16_t>(c.height), intrinsics, distortion);
}

int Dim(const ModelData& d) { return std::max(1, d.features.descriptor_dim); }

flatbuffers::Offset<fb::Landmarks> BuildLandmarks(flatbuffers::FlatBufferBuilder& b,
                                                  const ModelData& d) {
  const auto map_begin = b.CreateVector(d.map_begin);
  const auto map_origin = b.CreateVector(Flat(d.map_origin));
  const auto map_step = b.CreateVector(d.map_step);
  const auto position = b.CreateVector(Flat(d.landmark_position));
  const auto descriptors =
      BuildDescriptors(b, d.code_tables.landmark_descriptors, d.landmark_descriptors, Dim(d));
  const auto sign = b.CreateVector(d.landmark_laplacian_sign);
  const auto rarity = b.CreateVector(d.landmark_rarity);
  const auto map_metric = b.CreateVector(d.map_metric);
  const auto chroma = d.landmark_chroma.empty()
                          ? flatbuffers::Offset<fb::EncodedRows>()
                          : BuildDescriptors(b, d.code_tables.landmark_chroma, d.landmark_chroma,
                                             kLandmarkChromaDim);
  return fb::CreateLandmarks(b, map_begin, map_origin, map_step, position, descriptors, sign,
                             rarity, d.pixel_sigma, map_metric, chroma);
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

// As viewfix.fbs says it.
std::vector<std::vector<std::uint8_t>> KeyframeWords(const ModelData& d) {
  std::vector<std::vector<std::uint8_t>> rows;
  const auto add = [&](int step, int count) {
    rows.back().push_back(static_cast<std::uint8_t>((step - 1) * 8 + count));
  };
  for (std::size_t k = 0; k + 1 < d.keyframe_word_begin.size(); ++k) {
    rows.emplace_back();
    int word = -1;
    for (std::uint32_t j = d.keyframe_word_begin[k]; j < d.keyframe_word_begin[k + 1]; ++j) {
      for (; d.keyframe_words[j] - word > kMaxKeyframeStep; word += kMaxKeyframeStep) {
        add(kMaxKeyframeStep, 0);
      }
      add(d.keyframe_words[j] - word, std::min<int>(d.keyframe_counts[j], kMaxKeyframeCount));
      word = d.keyframe_words[j];
    }
  }
  return rows;
}

// Of each keyframe, landmarks that ascend; or no table of them.
bool HasKeyframeLandmarks(const ModelData& d) {
  const std::vector<std::uint32_t>& begin = d.keyframe_landmark_begin;
  if (begin.empty()) return d.keyframe_landmarks.empty();
  if (begin.front() != 0 || begin.back() != d.keyframe_landmarks.size() ||
      !std::ranges::is_sorted(begin)) {
    return false;
  }
  for (std::size_t k = 0; k + 1 < begin.size(); ++k) {
    for (std::uint32_t j = begin[k] + 1; j < begin[k + 1]; ++j) {
      if (d.keyframe_landmarks[j] <= d.keyframe_landmarks[j - 1]) return false;
    }
  }
  return true;
}

// As viewfix.fbs says it.
std::vector<std::vector<std::uint8_t>> KeyframeLandmarks(const ModelData& d) {
  std::vector<std::vector<std::uint8_t>> rows;
  for (std::size_t k = 0; k + 1 < d.keyframe_landmark_begin.size(); ++k) {
    rows.emplace_back();
    std::uint32_t next = 0;
    for (auto j = d.keyframe_landmark_begin[k]; j < d.keyframe_landmark_begin[k + 1]; ++j) {
      const std::uint32_t step = d.keyframe_landmarks[j] - next;
      rows.back().insert(rows.back().end(), step / 255, 255);
      rows.back().push_back(static_cast<std::uint8_t>(step % 255));
      next = d.keyframe_landmarks[j] + 1;
    }
  }
  return rows;
}

// As viewfix.fbs says it.
std::vector<std::vector<std::uint8_t>> KeyframeNames(const ModelData& d) {
  std::vector<std::vector<std::uint8_t>> rows;
  std::string before;
  for (const std::string& name : d.keyframe_names) {
    const auto differ = std::ranges::mismatch(before, name).in2;
    const auto shared = std::min<std::ptrdiff_t>(differ - name.begin(), 255);
    rows.push_back({static_cast<std::uint8_t>(shared)});
    rows.back().insert(rows.back().end(), name.begin() + shared, name.end());
    rows.back().push_back(0);
    before = name;
  }
  return rows;
}

flatbuffers::Offset<fb::Keyframes> BuildKeyframes(flatbuffers::FlatBufferBuilder& b,
                                                  const ModelData& d) {
  const ModelData::CodeTables& tables = d.code_tables;
  const auto pair = b.CreateVector(d.keyframe_pair);
  const auto entries = KeyframeWords(d);
  std::vector<std::uint32_t> begin = {0};
  for (const auto& row : entries) {
    begin.push_back(begin.back() + static_cast<std::uint32_t>(row.size()));
  }
  const auto word_begin = b.CreateVector(begin);
  const auto words = BuildRows(b, Encode(tables.keyframe_words, RowsOf(entries), kOneColumn));
  const auto has_pose = b.CreateVector(d.keyframe_has_pose);
  std::vector<std::array<float, 7>> poses;
  for (std::size_t k = 0; k < d.keyframe_pose.size(); ++k) {
    if (d.keyframe_has_pose[k] != 0) poses.push_back(d.keyframe_pose[k]);
  }
  const auto pose = b.CreateVector(Flat(poses));
  const auto landmark_begin = b.CreateVector(d.keyframe_landmark_begin);
  flatbuffers::Offset<fb::EncodedRows> landmarks = 0;
  if (!d.keyframe_landmark_begin.empty()) {
    landmarks =
        BuildRows(b, Encode(tables.keyframe_landmarks, RowsOf(KeyframeLandmarks(d)), kOneColumn));
  }
  flatbuffers::Offset<fb::EncodedRows> names = 0;
  if (!d.keyframe_names.empty()) {
    names = BuildRows(b, Encode(tables.keyframe_names, RowsOf(KeyframeNames(d)), kOneColumn));
  }
  return fb::CreateKeyframes(b, pair, word_begin, words, has_pose, pose, landmark_begin, landmarks,
                             names);
}

flatbuffers::Offset<fb::Details> BuildDetails(flatbuffers::FlatBufferBuilder& b,
                                              const ModelData& data) {
  const ModelData::DetailsData& d = data.details;
  if (d.codes.empty()) return 0;
  const auto rotation = b.CreateVector(d.rotation);
  const auto codebook = b.CreateVector(d.codebook);
  const auto list_size = BuildRows(
      b, Encode(data.code_tables.detail_lists,
                RowsOf(std::span(d.list_size), 2 * (data.words.size() / Dim(data))), kOneColumn));
  const auto codes = b.CreateVector(d.codes);
  return fb::CreateDetails(b, static_cast<std::uint8_t>(d.parts), rotation, codebook, list_size,
                           codes, d.likeness_weight, d.close_weight);
}

flatbuffers::Offset<fb::GoldenQueries> BuildGolden(flatbuffers::FlatBufferBuilder& b,
                                                   const ModelData& d) {
  const ModelData::GoldenData& g = d.golden;
  if (g.pair.empty()) return 0;
  const auto width = b.CreateVector(g.width);
  const auto height = b.CreateVector(g.height);
  const auto begin = b.CreateVector(g.begin);
  const auto keypoints = b.CreateVector(g.keypoints);
  const auto sign = b.CreateVector(g.laplacian_sign);
  const auto descriptors =
      BuildDescriptors(b, d.code_tables.golden_descriptors, g.descriptors, Dim(d));
  const auto pair = b.CreateVector(g.pair);
  const auto has_pose = b.CreateVector(g.has_pose);
  const auto pose = b.CreateVector(Flat(g.pose));
  return fb::CreateGoldenQueries(b, width, height, begin, keypoints, sign, descriptors, pair,
                                 has_pose, pose);
}

// Names that end where their rows do.
bool HasKeyframeNames(const ModelData& d) {
  const auto fits = [](const std::string& name) {
    return name.size() <= kMaxKeyframeNameBytes && name.find('\0') == std::string::npos;
  };
  return std::ranges::all_of(d.keyframe_names, fits);
}

bool HasCodeTables(const ModelData& d) {
  const ModelData::CodeTables& t = d.code_tables;
  const auto opens = [](const std::vector<std::uint8_t>* tables) {
    return HuffmanDecoder::Open(*tables, {}).has_value();
  };
  return std::ranges::all_of(
      std::array{&t.words, &t.weights, &t.keyframe_words, &t.keyframe_landmarks, &t.keyframe_names,
                 &t.landmark_descriptors, &t.landmark_chroma, &t.detail_lists,
                 &t.golden_descriptors},
      opens);
}

// As many numbers as rows of their lengths have.
bool HasWholeRows(const ModelData& d) {
  const std::size_t words = d.words.size() / Dim(d);
  const std::size_t lists = (d.locations.size() + 1) * 2 * words;
  return d.words.size() == words * Dim(d) &&
         d.landmark_descriptors.size() == d.landmark_position.size() * Dim(d) &&
         (d.landmark_chroma.empty() ||
          d.landmark_chroma.size() == d.landmark_position.size() * kLandmarkChromaDim) &&
         d.golden.descriptors.size() == d.golden.laplacian_sign.size() * Dim(d) &&
         d.keyframe_pose.size() == d.keyframe_has_pose.size() &&
         (d.details.codes.empty() || d.details.list_size.size() == lists);
}

// Everything is written, defaults too: a reader then sees each stated value.
flatbuffers::Offset<fb::Model> BuildModel(flatbuffers::FlatBufferBuilder& b, const ModelData& d) {
  const ModelFeatures& f = d.features;
  const auto features =
      fb::CreateFeatures(b, f.type, f.version, static_cast<std::uint16_t>(f.max_image_side),
                         static_cast<std::uint16_t>(f.max_features), f.upright, f.threshold,
                         static_cast<std::uint16_t>(f.descriptor_dim));
  const auto vocabulary =
      fb::CreateVocabulary(b, static_cast<std::uint32_t>(d.words.size() / Dim(d)),
                           static_cast<std::uint16_t>(f.descriptor_dim),
                           BuildDescriptors(b, d.code_tables.words, d.words, Dim(d)),
                           static_cast<std::uint8_t>(d.words_per_feature));
  const auto locations = b.CreateVectorOfStrings(d.locations);
  const auto views = b.CreateVectorOfStrings(d.views);
  const auto pair_location = b.CreateVector(d.pair_location);
  const auto pair_view = b.CreateVector(d.pair_view);
  const auto bias = b.CreateVector(d.bias);
  const auto weight_scale = b.CreateVector(d.weight_scale);
  const std::vector<std::uint8_t> packed = PackWeights(d);
  const int row = PackedWeights(static_cast<int>(d.pair_location.size()));
  const auto weights =
      BuildRows(b, Encode(d.code_tables.weights, RowsOf(std::span<const std::uint8_t>(packed), row),
                          kOneColumn));
  const auto scoring = fb::CreateScoring(
      b, static_cast<std::uint8_t>(d.histogram_map), static_cast<std::uint8_t>(d.location_rule),
      locations, views, pair_location, pair_view, bias, weight_scale, weights, d.keyframe_weight);
  const auto confidence =
      fb::CreateConfidence(b, d.confidence.offset, d.confidence.slope, d.confidence.threshold);
  const auto keyframes = BuildKeyframes(b, d);
  flatbuffers::Offset<fb::Camera> camera = 0;
  flatbuffers::Offset<fb::Landmarks> map = 0;
  if (!d.landmark_position.empty()) {
    camera = BuildCamera(b, d.camera);
    map = BuildLandmarks(b, d);
  }
  const auto details = BuildDetails(b, d);
  const auto golden = BuildGolden(b, d);
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
  d.landmark_chroma = Owned(l.chroma);
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

std::size_t DetailListBytes(std::span<const std::uint8_t> list_size, std::size_t lists) {
  return EncodeRows(RowsOf(list_size, lists), kOneColumn).size();
}

Result<std::vector<std::uint8_t>> WriteModel(const ModelData& data) {
  if (!HasHistograms(data)) {
    return Status(StatusCode::kInvalidArgument, "a keyframe's words do not ascend or occur");
  }
  if (!HasWeights(data)) {
    return Status(StatusCode::kInvalidArgument, "a weight for each pair and word, -8..7");
  }
  if (!HasKeyframeLandmarks(data)) {
    return Status(StatusCode::kInvalidArgument, "a keyframe's landmarks do not ascend");
  }
  if (!HasKeyframeNames(data)) {
    return Status(StatusCode::kInvalidArgument, "a keyframe's name is too long");
  }
  if (!HasCodeTables(data)) {
    return Status(StatusCode::kInvalidArgument, "code tables are not those of complete codes");
  }
  if (!HasWholeRows(data)) {
    return Status(StatusCode::kInvalidArgument,
                  "a row of descriptors, poses or lists is not whole");
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
  const ModelCodeTables tables = model.code_tables();
  data.code_tables = {.words = Owned(tables.words),
                      .weights = Owned(tables.weights),
                      .keyframe_words = Owned(tables.keyframe_words),
                      .keyframe_landmarks = Owned(tables.keyframe_landmarks),
                      .keyframe_names = Owned(tables.keyframe_names),
                      .landmark_descriptors = Owned(tables.landmark_descriptors),
                      .landmark_chroma = Owned(tables.landmark_chroma),
                      .detail_lists = Owned(tables.detail_lists),
                      .golden_descriptors = Owned(tables.golden_descriptors)};
  return data;
}

}  // namespace viewfix
