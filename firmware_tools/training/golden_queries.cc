// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/golden_queries.h"

#include <algorithm>
#include <numeric>
#include <type_traits>
#include <vector>

#include "platform/store/golden.h"

namespace viewfix {
namespace {

constexpr int kQueries = 3;
// Tried at most, evenly over the set, until as many are localized.
constexpr int kTries = 30;
// Of an image, the strongest: enough to be recognized, 21 kB.
constexpr int kFeatures = 250;

// Owned, as GoldenFeatures borrows them.
struct Query {
  int width = 0;
  int height = 0;
  std::vector<float> keypoints;
  std::vector<std::int8_t> laplacian_sign;
  std::vector<std::int8_t> descriptors;
};

Query StrongestOf(const ImageFeatures& image, int dim) {
  std::vector<std::size_t> order(image.keypoints.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return image.keypoints[a].response > image.keypoints[b].response;
  });
  order.resize(std::min<std::size_t>(order.size(), kFeatures));
  std::sort(order.begin(), order.end());
  Query query{image.width, image.height, {}, {}, {}};
  for (const std::size_t i : order) {
    const Keypoint& k = image.keypoints[i];
    query.keypoints.insert(query.keypoints.end(), {k.x, k.y, k.sigma, k.cos_angle, k.sin_angle});
    query.laplacian_sign.push_back(k.laplacian_sign);
    const auto begin = image.descriptors.begin() + static_cast<std::ptrdiff_t>(i * dim);
    query.descriptors.insert(query.descriptors.end(), begin, begin + dim);
  }
  return query;
}

void Add(const Query& query, const Fix& fix, ModelData::GoldenData& golden) {
  golden.width.push_back(static_cast<std::uint16_t>(query.width));
  golden.height.push_back(static_cast<std::uint16_t>(query.height));
  golden.keypoints.insert(golden.keypoints.end(), query.keypoints.begin(), query.keypoints.end());
  golden.laplacian_sign.insert(golden.laplacian_sign.end(), query.laplacian_sign.begin(),
                               query.laplacian_sign.end());
  golden.descriptors.insert(golden.descriptors.end(), query.descriptors.begin(),
                            query.descriptors.end());
  golden.begin.push_back(static_cast<std::uint32_t>(golden.laplacian_sign.size()));
  golden.pair.push_back(static_cast<std::uint16_t>(fix.pair_idx));
  golden.has_pose.push_back(fix.has_pose ? 1 : 0);
  golden.pose.emplace_back();
  if (!fix.has_pose) return;
  const Eigen::Vector3f t = fix.world_from_cam.translation.cast<float>();
  const Eigen::Quaternionf q = fix.world_from_cam.rotation.cast<float>();
  golden.pose.back() = {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()};
}

std::vector<int> Candidates(const FeatureStore& features) {
  std::vector<int> with_features;
  for (int i = 0; i < static_cast<int>(features.images.size()); ++i) {
    if (!features.images[i].keypoints.empty()) with_features.push_back(i);
  }
  std::vector<int> chosen;
  const int size = static_cast<int>(with_features.size());
  for (int i = 0; i < std::min(kTries, size); ++i) {
    chosen.push_back(with_features[std::size_t(i) * size / std::min(kTries, size)]);
  }
  // One of each third of the walk first.
  std::vector<int> spread;
  for (int start = 0; start < kTries / kQueries; ++start) {
    for (int i = start; i < static_cast<int>(chosen.size()); i += kTries / kQueries) {
      spread.push_back(chosen[i]);
    }
  }
  return spread;
}

// Wholly, as a board will be asked to.
bool Answers(const Fix& fix, const ModelView& model) {
  return fix.localized && fix.level == 0 && fix.has_pose == model.has_landmarks();
}

bool SamePlace(const ModelData& a, int pair_a, const ModelData& b, int pair_b) {
  return a.locations[a.pair_location[pair_a]] == b.locations[b.pair_location[pair_b]] &&
         a.views[a.pair_view[pair_a]] == b.views[b.pair_view[pair_b]];
}

Query QueryAt(const ModelData& model, std::size_t i) {
  const ModelData::GoldenData& golden = model.golden;
  const auto part = [&](const auto& all, std::size_t width) {
    const auto begin = all.begin() + static_cast<std::ptrdiff_t>(golden.begin[i] * width);
    const auto end = all.begin() + static_cast<std::ptrdiff_t>(golden.begin[i + 1] * width);
    return std::decay_t<decltype(all)>(begin, end);
  };
  return {golden.width[i], golden.height[i], part(golden.keypoints, 5),
          part(golden.laplacian_sign, 1), part(golden.descriptors, model.features.descriptor_dim)};
}

GoldenFeatures Borrowed(const Query& query) {
  return {query.width, query.height, query.keypoints, query.laplacian_sign, query.descriptors};
}

}  // namespace

void AddGoldenQueries(const FeatureStore& features, const ModelData* base, ModelData& model) {
  const auto bytes = WriteModel(model);
  if (!bytes.ok()) return;  // whoever writes the model says so
  const Result<ModelView> view = ModelView::Open(*bytes);
  Result<GoldenLocalizer> localizer = GoldenLocalizer::Create(*view);
  if (!localizer.ok()) return;
  for (std::size_t i = 0; base != nullptr && i < base->golden.pair.size(); ++i) {
    const Query query = QueryAt(*base, i);
    const Result<Fix> fix = localizer->Localize(Borrowed(query));
    if (!fix.ok() || !Answers(*fix, *view)) continue;
    if (SamePlace(model, fix->pair_idx, *base, base->golden.pair[i]))
      Add(query, *fix, model.golden);
  }
  for (const int i : Candidates(features)) {
    if (static_cast<int>(model.golden.pair.size()) >= kQueries) return;
    const Query query = StrongestOf(features.images[i], features.dim);
    const Result<Fix> fix = localizer->Localize(Borrowed(query));
    if (fix.ok() && Answers(*fix, *view)) Add(query, *fix, model.golden);
  }
}

}  // namespace viewfix
