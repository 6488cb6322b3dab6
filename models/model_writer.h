// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/base/status.h"
#include "models/model_view.h"

namespace viewfix {

// A model's contents, owned; shapes and ranges as in viewfix.fbs. Locations and views
// ascend by name, pairs by (location, view), keyframes by pair.
struct ModelData {
  ModelFeatures features;
  std::vector<std::int8_t> words;  // [num_words, features.descriptor_dim]
  int words_per_feature = 1;
  HistogramMap histogram_map = HistogramMap::kHellinger;
  LocationRule location_rule = LocationRule::kBestPair;
  std::vector<std::string> locations;
  std::vector<std::string> views;
  std::vector<std::uint16_t> pair_location;
  std::vector<std::uint16_t> pair_view;
  std::vector<float> bias;
  std::vector<float> weight_scale;
  std::vector<std::int8_t> weights;  // [num_words, pairs] -8..7
  float keyframe_weight = 0;
  ModelConfidence confidence;
  std::optional<ModelPoseConfidence> pose_confidence;
  std::vector<std::uint16_t> keyframe_pair;
  std::vector<std::uint32_t> keyframe_word_begin = {0};  // into the next two
  std::vector<std::uint16_t> keyframe_words;
  std::vector<std::uint8_t> keyframe_counts;
  std::vector<std::uint8_t> keyframe_has_pose;
  std::vector<std::array<float, 7>> keyframe_pose;  // tx ty tz qx qy qz qw
  std::vector<std::string> keyframe_names;          // or none
  // Where landmarks are; empty vectors: none.
  struct CameraData {
    std::uint8_t model = 0;
    int width = 0;
    int height = 0;
    std::array<double, 4> intrinsics{};
    std::array<double, 8> distortion{};
  } camera;
  std::vector<std::uint32_t> keyframe_landmark_begin;
  std::vector<std::uint32_t> keyframe_landmarks;
  std::vector<std::uint32_t> map_begin;
  std::vector<std::array<float, 3>> map_origin;
  std::vector<float> map_step;
  std::vector<std::uint8_t> map_metric;
  std::vector<std::array<std::int16_t, 3>> landmark_position;
  std::vector<std::int8_t> landmark_descriptors;  // [landmarks, features.descriptor_dim]
  std::vector<std::int8_t> landmark_laplacian_sign;
  std::vector<std::uint8_t> landmark_rarity;
  std::vector<std::int8_t> landmark_chroma;  // [landmarks, kLandmarkChromaDim], or none
  float pixel_sigma = 1;
  bool metric = false;
  // An empty picture: none.
  struct FloorPlanData {
    std::vector<std::uint8_t> picture;  // a PNG or JPEG file
    int width = 0;
    int height = 0;
    std::array<double, 4> site_from_pixel{};
  } floor_plan;
  // No codes: none.
  struct DetailsData {
    int parts = 0;
    std::vector<std::int8_t> rotation;
    std::vector<std::int8_t> codebook;
    std::vector<std::uint8_t> list_size;
    std::vector<std::uint8_t> codes;
    float likeness_weight = 0;
    float close_weight = 0;
  } details;
  // No pairs: none.
  struct GoldenData {
    std::vector<std::uint16_t> width;
    std::vector<std::uint16_t> height;
    std::vector<std::uint32_t> begin = {0};
    std::vector<float> keypoints;
    std::vector<std::int8_t> laplacian_sign;
    std::vector<std::int8_t> descriptors;
    std::vector<std::uint16_t> pair;
    std::vector<std::uint8_t> has_pose;
    std::vector<std::array<float, 7>> pose;
  } golden;
  std::string record;
  // By which rows are encoded (models/huffman_decoder.h); empty: by those that suit them best.
  struct CodeTables {
    std::vector<std::uint8_t> words;
    std::vector<std::uint8_t> weights;
    std::vector<std::uint8_t> keyframe_words;
    std::vector<std::uint8_t> keyframe_landmarks;
    std::vector<std::uint8_t> keyframe_names;
    std::vector<std::uint8_t> landmark_descriptors;
    std::vector<std::uint8_t> landmark_chroma;
    std::vector<std::uint8_t> detail_lists;
    std::vector<std::uint8_t> golden_descriptors;
  } code_tables;
};

// Bytes that the sizes of details' lists take in a file, by tables of their own.
//   list_size [locations + 1, lists]
std::size_t DetailListBytes(std::span<const std::uint8_t> list_size, std::size_t lists);

// The whole file, header included: the same data give the same bytes. The result has been
// read back by ModelView; its refusal is returned if the data break the contract.
Result<std::vector<std::uint8_t>> WriteModel(const ModelData& data);

// What a model was written from: WriteModel() of it gives the same bytes again.
ModelData UnpackModel(const ModelView& model);

}  // namespace viewfix
