// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/feature_store.h"

#include <algorithm>
#include <mutex>

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

ImageFeatures ExtractOne(const std::filesystem::path& path, Worker& worker) {
  ExifInfo exif;
  const GreyImage image = LoadGreyImage(path, &exif);
  const ImageView working = worker.shrinker.ShrinkToSide(image.view());
  const Status status = worker.extractor->Extract(working, worker.features);
  if (!status.ok()) throw ToolError(path.string() + ": " + status.text());
  const FeatureSet& f = worker.features;
  if (f.size() < kMinFeatures) {
    throw ToolError(path.string() + ": only " + std::to_string(f.size()) +
                    " features: blank, dark or blurred");
  }
  return {working.width,
          working.height,
          exif,
          {f.keypoints().begin(), f.keypoints().end()},
          {f.descriptors().begin(), f.descriptors().end()}};
}

}  // namespace

std::unique_ptr<FeatureExtractor> MakeExtractor(const FeatureOptions& options) {
  if (options.type == FeatureType::kSift) return CreateSiftExtractor(options);
  auto extractor = CreateFeatureExtractor(options);
  if (!extractor.ok()) throw ToolError(std::string("features: ") + extractor.status().text());
  return std::move(*extractor);
}

FeatureStore ExtractFeatures(const ImageSet& set, std::span<const int> image_idxs,
                             const FeatureOptions& options, int jobs, const Progress& progress) {
  FeatureStore store;
  store.options = options;
  store.images.resize(set.images.size());
  std::vector<Worker> workers;
  for (int w = 0; w < Workers(jobs); ++w) workers.emplace_back(options);
  store.dim = workers[0].extractor->descriptor_dim();
  store.version = workers[0].extractor->version();
  std::mutex mutex;  // guards failures
  const auto extract = [&](int i, int worker) {
    const int image_idx = image_idxs[i];
    try {
      store.images[image_idx] = ExtractOne(set.FullPath(set.images[image_idx]), workers[worker]);
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
