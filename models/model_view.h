// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/status.h"

namespace viewfix {

// The fixed header of a model file, little endian:
//   0  magic            8 bytes "VIEWFIX\0"
//   8  format version   u32
//   12 header length    u32, 64
//   16 payload length   u64, the FlatBuffer of viewfix.fbs; the file ends with it
//   24 reserved         8 bytes, zero
//   32 hash             32 bytes: BLAKE2b-256 of bytes 0..31 and the payload
inline constexpr std::array<std::uint8_t, 8> kModelMagic = {'V', 'I', 'E', 'W', 'F', 'I', 'X', 0};
inline constexpr std::uint32_t kModelFormatVersion = 4;
inline constexpr std::size_t kModelHeaderBytes = 64;
inline constexpr std::size_t kModelHashOffset = 32;
inline constexpr std::size_t kModelHashBytes = 32;

inline constexpr int kMaxWordsPerFeature = 4;
inline constexpr int kMaxLandmarks = 1 << 24;
inline constexpr int kMaxDetails = 1 << 24;
inline constexpr int kCodesOfPart = 256;
inline constexpr int kMaxGoldenQueries = 16;
inline constexpr std::size_t kMaxKeyframeNameBytes = 4095;  // as long as a path may be
// Of all that is encoded together: no file makes a board ask for more. 10,000 locations of 3 views
// with 2000 words take 70 MB.
inline constexpr std::uint64_t kMaxDecodedBytes = 128 << 20;
inline constexpr std::size_t kMaxFloorPlanBytes = 4 << 20;

// Values are stored in models: do not change them.
enum class HistogramMap : std::uint8_t { kL1 = 1, kHellinger = 2 };
enum class LocationRule : std::uint8_t { kBestPair = 1, kSumOfPairs = 2 };

// The parts of a model, as viewfix.fbs describes them; spans point into the file's bytes, or, of
// what is encoded there, into memory that the view and its copies share.
struct ModelFeatures {
  std::uint8_t type = 0;
  std::uint32_t version = 0;
  int max_image_side = 0;
  int max_features = 0;
  bool upright = false;
  float threshold = 0;
  int descriptor_dim = 0;
};

struct ModelVocabulary {
  int num_words = 0;
  int dim = 0;
  std::span<const std::int8_t> words;  // [num_words, dim]
  int words_per_feature = 1;
};

struct ModelScoring {
  HistogramMap histogram_map = HistogramMap::kHellinger;
  LocationRule location_rule = LocationRule::kBestPair;
  int num_locations = 0;
  int num_views = 0;
  int num_pairs = 0;
  std::span<const std::uint16_t> pair_location;  // [pairs]
  std::span<const std::uint16_t> pair_view;      // [pairs]
  std::span<const float> bias;                   // [pairs]
  std::span<const float> weight_scale;           // [pairs]
  std::span<const std::uint8_t> weights;         // [words, PackedWeights(pairs)]
  float keyframe_weight = 0;
};

// Weights are -8..7, two a byte.
inline constexpr int kWeightBias = 8;
constexpr int PackedWeights(int num_pairs) { return (num_pairs + 1) / 2; }
//   row  one word's weights
constexpr int WeightOf(std::span<const std::uint8_t> row, int pair) {
  const int both = row[pair / 2];
  return (pair % 2 == 0 ? both & 15 : both >> 4) - kWeightBias;
}

struct ModelConfidence {
  float offset = 0;
  float slope = 0;
  float threshold = 0;
};

// Of a pose among landmarks: engine/pose/pose_confidence.h.
constexpr int kPoseCues = 3;
struct ModelPoseConfidence {
  float offset = 0;
  std::array<float, kPoseCues> weights = {};
  float threshold = 0;
};

// An entry of a keyframe's histogram in one byte.
inline constexpr int kMaxKeyframeStep = 32;
inline constexpr int kMaxKeyframeCount = 7;
inline int StepOf(std::uint8_t entry) { return (entry >> 3) + 1; }
inline int CountOf(std::uint8_t entry) { return entry & 7; }

struct ModelKeyframes {
  int size = 0;
  std::span<const std::uint16_t> pair;            // [size]
  std::span<const std::uint32_t> word_begin;      // [size + 1]
  std::span<const std::uint8_t> words;            // coded: StepOf(), CountOf()
  std::span<const std::uint8_t> has_pose;         // [size]
  std::span<const float> pose;                    // [size, 7] tx ty tz qx qy qz qw; zeros: none
  std::span<const std::uint32_t> landmark_begin;  // [size + 1]; empty where no landmarks are
  std::span<const std::uint32_t> landmarks;
};

struct ModelCamera {
  std::uint8_t model = 0;
  int width = 0;
  int height = 0;
  std::span<const double> intrinsics;  // [4] fx fy cx cy
  std::span<const double> distortion;  // [8]
};

// How colours differ about a landmark (engine/features/chroma_contrast.h), in steps.
inline constexpr int kLandmarkChromaDim = 8;
inline constexpr int kLandmarkChromaStep = 8;
inline constexpr std::int8_t kNoLandmarkChroma =
    -128;  // in the first place: it was seen in grey alone

struct ModelLandmarks {
  int size = 0;
  int num_maps = 0;
  std::span<const std::uint32_t> map_begin;     // [maps + 1]
  std::span<const float> map_origin;            // [maps, 3]
  std::span<const float> map_step;              // [maps]
  std::span<const std::int16_t> position;       // [size, 3]
  std::span<const std::int8_t> descriptors;     // [size, dim]
  std::span<const std::int8_t> laplacian_sign;  // [size]
  std::span<const std::uint8_t> rarity;         // [size]
  float pixel_sigma = 1;
  std::span<const std::uint8_t> map_metric;  // [maps] 0 or 1; empty: all as the model
  std::span<const std::int8_t> chroma;       // [size, kLandmarkChromaDim] steps; empty: not known
};

// Sizes and order as in viewfix.fbs.
struct ModelDetails {
  int size = 0;
  int parts = 0;                            // S
  std::span<const std::int8_t> rotation;    // [turned dim, dim]
  std::span<const std::int8_t> codebook;    // [parts, kCodesOfPart, turned dim / parts]
  std::span<const std::uint8_t> list_size;  // [locations + 1, 2 words]
  std::span<const std::uint8_t> codes;      // [size, parts]
  float likeness_weight = 0;
  float close_weight = 0;
};

// x = a px + b py + tx, y = b px - a py + ty, metres.
struct ModelFloorPlan {
  std::span<const std::uint8_t> picture;  // a PNG or JPEG file; empty: none
  int width = 0;                          // pixels
  int height = 0;
  std::span<const double> site_from_pixel;  // [4] a b tx ty
};

// Sizes and order as in viewfix.fbs.
struct ModelGolden {
  int size = 0;
  std::span<const std::uint16_t> width;   // [size]
  std::span<const std::uint16_t> height;  // [size]
  std::span<const std::uint32_t> begin;   // [size + 1]
  std::span<const float> keypoints;       // [features, 5]
  std::span<const std::int8_t> laplacian_sign;
  std::span<const std::int8_t> descriptors;  // [features, dim]
  std::span<const std::uint16_t> pair;       // [size]
  std::span<const std::uint8_t> has_pose;    // [size]
  std::span<const float> pose;               // [size, 7]
};

// Whether a file begins as a PNG or a JPEG.
bool IsFloorPlanPicture(std::span<const std::uint8_t> file);

// Bytes of the file, the larger parts, by what they are for.
struct ModelSections {
  std::size_t vocabulary = 0;
  std::size_t weights = 0;
  std::size_t keyframe_histograms = 0;
  std::size_t keyframe_poses = 0;
  std::size_t keyframe_landmarks = 0;
  std::size_t keyframe_names = 0;
  std::size_t landmark_positions = 0;
  std::size_t landmark_descriptors = 0;
  std::size_t landmark_chroma = 0;
  std::size_t details = 0;
  std::size_t golden_queries = 0;
  std::size_t floor_plan = 0;
  std::size_t record = 0;
};

// Tables of a model's encoded rows (models/huffman_decoder.h).
struct ModelCodeTables {
  std::span<const std::uint8_t> words;
  std::span<const std::uint8_t> weights;
  std::span<const std::uint8_t> keyframe_words;
  std::span<const std::uint8_t> keyframe_landmarks;
  std::span<const std::uint8_t> keyframe_names;
  std::span<const std::uint8_t> landmark_descriptors;
  std::span<const std::uint8_t> landmark_chroma;
  std::span<const std::uint8_t> detail_lists;
  std::span<const std::uint8_t> golden_descriptors;
};

// A model file, opened over borrowed bytes. Everything is checked once, in Open(), which decodes
// what is encoded and allocates memory for that alone; afterwards every index is in range and every
// number finite. Copies share what was decoded.
class ModelView {
 public:
  // `bytes` must stay unchanged while the view is used, and start at an address that is a
  // multiple of 8 (as any allocation does). kCorrupt: not a model, truncated, or any bit
  // changed, or what is encoded takes more than kMaxDecodedBytes; kUnsupported: another format
  // version. The reader never crashes on any bytes.
  static Result<ModelView> Open(std::span<const std::uint8_t> bytes);

  const ModelFeatures& features() const { return features_; }
  const ModelVocabulary& vocabulary() const { return vocabulary_; }
  const ModelScoring& scoring() const { return scoring_; }
  const ModelConfidence& confidence() const { return confidence_; }
  // None: poses are believed by fixed rules alone.
  const std::optional<ModelPoseConfidence>& pose_confidence() const { return pose_confidence_; }
  const ModelKeyframes& keyframes() const { return keyframes_; }
  bool has_landmarks() const { return landmarks_.size > 0; }
  const ModelCamera& camera() const { return camera_; }           // where landmarks are
  const ModelLandmarks& landmarks() const { return landmarks_; }  // none: size 0
  bool has_floor_plan() const { return !floor_plan_.picture.empty(); }
  const ModelFloorPlan& floor_plan() const { return floor_plan_; }
  bool has_details() const { return details_.size > 0; }
  const ModelDetails& details() const { return details_; }  // none: size 0
  const ModelGolden& golden() const { return golden_; }     // none: size 0
  bool metric() const { return metric_; }  // at least the first map's units are metres
  bool metric(int map_idx) const {
    return landmarks_.map_metric.empty() ? metric_ : landmarks_.map_metric[map_idx] != 0;
  }
  std::string_view record() const { return record_; }  // JSON
  ModelSections sections() const;
  ModelCodeTables code_tables() const;

  // The map that a landmark is of.
  int MapOf(std::uint32_t landmark_idx) const;

  std::string_view location_name(int location_idx) const;
  std::string_view view_name(int view_idx) const;
  // The photograph it was, as a path in the image set; empty: not told.
  std::string_view keyframe_name(int keyframe_idx) const;

  std::span<const std::uint8_t> bytes() const { return bytes_; }
  std::span<const std::uint8_t> hash() const {
    return bytes_.subspan(kModelHashOffset, kModelHashBytes);
  }
  // The first 8 bytes of hash() as 16 hexadecimal digits: how a model is named in output.
  std::array<char, 16> short_hash() const;

 private:
  Status Load();
  Status LoadFeatures();
  Status LoadVocabulary();
  Status LoadScoring();
  Status LoadConfidence();
  Status LoadPoseConfidence();
  Status LoadKeyframes();
  Status LoadKeyframePoses();
  Status LoadKeyframeNames();
  Status LoadCamera();
  Status LoadLandmarks();
  Status LoadKeyframeLandmarks();
  Status LoadFloorPlan();
  Status LoadDetails();
  Status LoadGolden();

  // What was encoded.
  struct Decoded {
    std::uint64_t room = kMaxDecodedBytes;  // for more
    std::vector<std::int8_t> words;
    std::vector<std::uint8_t> weights;
    std::vector<std::uint8_t> keyframe_words;
    std::vector<float> keyframe_pose;
    std::vector<std::uint32_t> keyframe_landmarks;
    std::vector<std::string> keyframe_names;
    std::vector<std::int8_t> landmark_descriptors;
    std::vector<std::int8_t> landmark_chroma;
    std::vector<std::uint8_t> detail_lists;
    std::vector<std::int8_t> golden_descriptors;
  };

  std::span<const std::uint8_t> bytes_;
  std::shared_ptr<Decoded> decoded_;
  ModelFeatures features_;
  ModelVocabulary vocabulary_;
  ModelScoring scoring_;
  ModelConfidence confidence_;
  std::optional<ModelPoseConfidence> pose_confidence_;
  ModelKeyframes keyframes_;
  ModelCamera camera_;
  ModelLandmarks landmarks_;
  ModelFloorPlan floor_plan_;
  ModelDetails details_;
  ModelGolden golden_;
  bool metric_ = false;
  std::string_view record_;
};

// BLAKE2b-256 as the header holds it: of the header's first 32 bytes and the payload.
std::array<std::uint8_t, kModelHashBytes> HashModel(std::span<const std::uint8_t> file);

}  // namespace viewfix
