// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/feature_store.h"

#include <algorithm>
#include <mutex>
#include <opencv2/core.hpp>

#include "engine/image/resize.h"
#include "engine/localizer.h"
#include "firmware_tools/dataset/image_loader.h"
#include "firmware_tools/training/sift_extractor.h"

namespace viewfix {
namespace {

// One thread's tools: made once, used for many images.
struct Worker {
  explicit Worker(const FeatureOptions& options)
      : extractor(MakeExtractor(options)),
        shrinker(options.max_image_side),
        features(options.max_features, extractor->descriptor_dim()) {}

  std::unique_ptr<FeatureExtractor> extractor;
  Shrinker shrinker;
  FeatureSet features;
};

ImageFeatures ExtractOne(const std::filesystem::path& path, const std::string& bytes,
                         Worker& worker) {
  ExifInfo exif;
  const YuvImage image = DecodeImage(path, bytes, &exif);
  const ImageView working = worker.shrinker.ShrinkToSide(image.view());
  const Status status = worker.extractor->Extract(working, worker.features);
  if (!status.ok()) throw ToolError(path.string() + ": " + status.text());
  const FeatureSet& f = worker.features;
  if (f.size() < kMinFeatures) {
    throw ToolError(path.string() + ": only " + std::to_string(f.size()) +
                    " features: blank, dark or blurred");
  }
  ImageFeatures found = {working.width,
                         working.height,
                         exif,
                         {f.keypoints().begin(), f.keypoints().end()},
                         {f.descriptors().begin(), f.descriptors().end()},
                         {}};
  if (f.has_chroma()) found.chroma.assign(f.chroma().begin(), f.chroma().end());
  return found;
}

// Rises whenever the same file and options would give something else, the extractor itself being
// the same: by another decoder, shrinker, or file below.
constexpr int kKeptVersion = 2;

Hash256 KeyOf(const std::string& bytes, const FeatureOptions& options,
              const FeatureExtractor& extractor) {
  ContentHash key;
  key.AddText("features");
  key.Add(kKeptVersion);
  key.AddText(cv::getVersionString());  // it decodes what is no JPEG, and finds SIFT
  key.Add(extractor.version());
  key.Add(options.type);
  key.Add(options.max_image_side);
  key.Add(options.max_features);
  key.Add(options.upright);
  key.Add(options.threshold);
  key.AddText(bytes);
  return key.Result();
}

// Of an ImageFeatures in a file.
struct Codec {
  int dim;

  void Save(const ImageFeatures& features, ByteWriter& writer) const {
    writer.Add(features.width);
    writer.Add(features.height);
    writer.Add(features.exif.orientation);
    writer.Add(std::uint8_t{features.exif.focal_length_35mm.has_value()});
    writer.Add(features.exif.focal_length_35mm.value_or(0));
    writer.Add(std::uint64_t{features.keypoints.size()});
    for (const Keypoint& k : features.keypoints) {
      for (const float v : {k.x, k.y, k.sigma, k.cos_angle, k.sin_angle, k.response}) writer.Add(v);
      writer.Add(k.laplacian_sign);
    }
    writer.AddAll(std::span<const std::int8_t>(features.descriptors));
    writer.Add(std::uint8_t{!features.chroma.empty()});
    writer.AddAll(std::span<const std::int8_t>(features.chroma));
  }

  bool Load(ByteReader& reader, ImageFeatures& features) const {
    constexpr std::size_t kKeypointBytes = 6 * sizeof(float) + 1;
    features.width = reader.Take<int>();
    features.height = reader.Take<int>();
    features.exif.orientation = reader.Take<int>();
    const bool has_focal_length = reader.Take<std::uint8_t>() != 0;
    const auto focal_length = reader.Take<double>();
    if (has_focal_length) features.exif.focal_length_35mm = focal_length;
    const auto count = reader.Take<std::uint64_t>();
    if (!reader.Has(count, kKeypointBytes + dim)) return false;
    features.keypoints.resize(count);
    for (Keypoint& k : features.keypoints) {
      for (float* v : {&k.x, &k.y, &k.sigma, &k.cos_angle, &k.sin_angle, &k.response}) {
        *v = reader.Take<float>();
      }
      k.laplacian_sign = reader.Take<std::int8_t>();
    }
    features.descriptors.resize(count * dim);
    reader.TakeAll(std::span(features.descriptors));
    if (!reader.Has(1, 1)) return false;
    if (reader.Take<std::uint8_t>() == 0) return true;
    if (!reader.Has(count, kChromaDim)) return false;
    features.chroma.resize(count * kChromaDim);
    reader.TakeAll(std::span(features.chroma));
    return true;
  }
};

}  // namespace

std::unique_ptr<FeatureExtractor> MakeExtractor(const FeatureOptions& options) {
  if (options.type == FeatureType::kSift) return CreateSiftExtractor(options);
  auto extractor = CreateFeatureExtractor(options);
  if (!extractor.ok()) throw ToolError(std::string("features: ") + extractor.status().text());
  return std::move(*extractor);
}

FeatureStore ExtractFeatures(const ImageSet& set, std::span<const int> image_idxs,
                             const FeatureOptions& options, int jobs, const Progress& progress,
                             StageCache* cache) {
  FeatureStore store;
  store.options = options;
  store.images.resize(set.images.size());
  std::vector<Worker> workers;
  for (int w = 0; w < Workers(jobs); ++w) workers.emplace_back(options);
  store.dim = workers[0].extractor->descriptor_dim();
  store.version = workers[0].extractor->version();
  const std::string stage = "features (" + std::to_string(options.max_features) + " an image)";
  std::mutex mutex;  // guards failures
  const auto extract = [&](int i, int worker) {
    const int image_idx = image_idxs[i];
    const std::filesystem::path path = set.FullPath(set.images[image_idx]);
    try {
      const std::string bytes = ReadImageFile(path);
      const auto compute = [&] { return ExtractOne(path, bytes, workers[worker]); };
      store.images[image_idx] =
          cache == nullptr ? compute()
                           : cache->Recall(stage, KeyOf(bytes, options, *workers[worker].extractor),
                                           Codec{store.dim}, compute);
    } catch (const ToolError& error) {
      const std::lock_guard lock(mutex);
      store.failures.push_back({image_idx, error.what()});
    }
  };
  ParallelForWorkers(static_cast<int>(image_idxs.size()), jobs, extract, progress);
  std::sort(store.failures.begin(), store.failures.end(),
            [](const auto& a, const auto& b) { return a.image_idx < b.image_idx; });
  return store;
}

}  // namespace viewfix
