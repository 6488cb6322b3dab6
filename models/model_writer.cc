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
                           codes, d.likeness_weight);
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
  const auto weights = b.CreateVector(d.weights);
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
void PutLittleEndian(std::uint8_t* to, T value) {
  std::memcpy(to, &value, sizeof value);
}

}  // namespace

Result<std::vector<std::uint8_t>> WriteModel(const ModelData& data) {
  if (!HasHistograms(data)) {
    return Status(StatusCode::kInvalidArgument, "a keyframe's words do not ascend or occur");
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

}  // namespace viewfix
