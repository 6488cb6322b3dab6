// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/base/status.h"
#include "engine/image/image_view.h"

namespace viewfix {

// Values are stored in models: do not change them.
enum class FeatureType : std::uint8_t {
  kSurf = 1,
  kSift = 2,
  kColorSurf = 3,   // SURF and, behind it, how colours differ within its square
  kSurfChroma = 4,  // SURF and, beside it, the same of the colours
};

// "surf", "sift", "color-surf", "surf-chroma": as users say it; "unknown" of other values.
const char* FeatureTypeName(FeatureType type);

// Whether its features are others where an image's colours are known.
constexpr bool SeesColours(FeatureType type) {
  return type == FeatureType::kColorSurf || type == FeatureType::kSurfChroma;
}

// Numbers that say how colours differ about a key point (chroma_contrast.h).
inline constexpr int kChromaDim = 8;

// How features are found. Stored in the model, so that laptop and board do the
// same.
struct FeatureOptions {
  FeatureType type = FeatureType::kSurf;
  // Longest side of the image that features are found in, pixels, 64..4096;
  // larger images are shrunk to it first (image/resize.h).
  int max_image_side = 640;
  // At most this many features an image, 16..8192, spread by a grid.
  int max_features = 800;
  // No orientation: faster, for cameras that never roll.
  bool upright = false;
  // Least determinant of the Hessian (grey values in 0..1, box filters of unit
  // area); low, since the grid picks the best.
  float threshold = 1e-5F;

  Status Validate() const;
  friend bool operator==(const FeatureOptions&, const FeatureOptions&) = default;
};

struct Keypoint {
  float x = 0;  // pixels of the image given to Extract(), centres at integers
  float y = 0;
  float sigma = 0;      // scale, pixels; SURF: 1.2 / 9 of the filter's side, as in the paper
  float cos_angle = 1;  // orientation as a unit vector (image axes: x right, y down)
  float sin_angle = 0;
  float response = 0;              // strength, > 0
  std::int8_t laplacian_sign = 1;  // +1 dark blob on light, -1 light on dark, 0 not known
};

// Key points and their descriptors, of a capacity fixed when made. Descriptor i
// is `dim` signed bytes, of Euclidean length about 127 before rounding (chroma comes on top). Where
// the features have chroma beside their descriptors, and the image has colours, has_chroma().
class FeatureSet {
 public:
  FeatureSet(int capacity, int dim)
      : dim_(dim),
        keypoints_(capacity),
        descriptors_(std::size_t(capacity) * dim),
        chroma_(std::size_t(capacity) * kChromaDim) {}

  int size() const { return size_; }
  int capacity() const { return static_cast<int>(keypoints_.size()); }
  int dim() const { return dim_; }
  void Clear() {
    size_ = 0;
    has_chroma_ = false;
  }

  // The slot after the last one, counted in; needs size() < capacity().
  int Append(const Keypoint& keypoint) {
    keypoints_[size_] = keypoint;
    return size_++;
  }

  std::span<const Keypoint> keypoints() const { return {keypoints_.data(), std::size_t(size_)}; }
  std::span<const std::int8_t> descriptor(int i) const {
    return {descriptors_.data() + std::size_t(i) * dim_, std::size_t(dim_)};
  }
  std::span<std::int8_t> mutable_descriptor(int i) {
    return {descriptors_.data() + std::size_t(i) * dim_, std::size_t(dim_)};
  }
  Keypoint& mutable_keypoint(int i) { return keypoints_[i]; }
  // All descriptors, one after another: [size() * dim()].
  std::span<const std::int8_t> descriptors() const {
    return {descriptors_.data(), std::size_t(size_) * dim_};
  }

  bool has_chroma() const { return has_chroma_; }
  void set_has_chroma(bool has_chroma) { has_chroma_ = has_chroma; }
  // [size() * kChromaDim], one key point's after another's; only where has_chroma().
  std::span<const std::int8_t> chroma() const {
    return {chroma_.data(), std::size_t(size_) * kChromaDim};
  }
  std::span<std::int8_t, kChromaDim> mutable_chroma(int i) {
    return std::span<std::int8_t, kChromaDim>(chroma_.data() + std::size_t(i) * kChromaDim,
                                              std::size_t{kChromaDim});
  }

 private:
  int dim_;
  int size_ = 0;
  bool has_chroma_ = false;
  std::vector<Keypoint> keypoints_;
  std::vector<std::int8_t> descriptors_;
  std::vector<std::int8_t> chroma_;
};

// Finds and describes local features. One instance serves one thread. After
// construction, an implementation meant for the board allocates nothing.
// Deterministic: the same pixels give the same bytes on every processor.
class FeatureExtractor {
 public:
  virtual ~FeatureExtractor() = default;
  virtual int descriptor_dim() const = 0;
  // Changes whenever the same pixels and options would give other features;
  // stored in the model beside FeatureOptions.
  virtual std::uint32_t version() const = 0;
  // Clears and fills `features` (dim() == descriptor_dim(), capacity() >=
  // max_features): grid cells row by row, strongest first inside a cell. An image
  // too small or too plain gives none: that is an outcome, not an error.
  // kInvalidArgument: empty view, sides above max_image_side, wrong dim.
  virtual Status Extract(const ImageView& image, FeatureSet& features) = 0;
};

// What every Extract() checks first, as stated there.
Status CheckExtractArguments(const FeatureExtractor& extractor, const FeatureOptions& options,
                             const ImageView& image, const FeatureSet& features);

// The board's extractors (SURF). kUnsupported for a type that this build lacks;
// laptop-only types come from firmware_tools/training/sift_extractor.h.
Result<std::unique_ptr<FeatureExtractor>> CreateFeatureExtractor(const FeatureOptions& options);

}  // namespace viewfix
