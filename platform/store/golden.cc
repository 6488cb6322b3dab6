// SPDX-License-Identifier: BSD-3-Clause
#include "platform/store/golden.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

namespace viewfix {
namespace {

constexpr double kMaxOffset = 0.05;            // metres, or units of the map
constexpr double kMinRotationDot = 0.9999619;  // cosine of half a degree: 1 degree apart

bool SamePose(const Rigid3& found, std::span<const float> pose) {
  const Eigen::Vector3d t(pose[0], pose[1], pose[2]);
  const Eigen::Quaterniond q(pose[6], pose[3], pose[4], pose[5]);
  return (found.translation - t).norm() <= kMaxOffset &&
         std::abs(Eigen::Quaterniond(found.rotation).dot(q)) >= kMinRotationDot;
}

}  // namespace

class GoldenLocalizer::Extractor : public FeatureExtractor {
 public:
  explicit Extractor(const ModelFeatures& model)
      : dim_(model.descriptor_dim), version_(model.version) {}

  void Give(const GoldenFeatures& features) { given_ = features; }
  int descriptor_dim() const override { return dim_; }
  std::uint32_t version() const override { return version_; }

  Status Extract(const ImageView& /*image*/, FeatureSet& features) override {
    features.Clear();
    const std::size_t count = given_.laplacian_sign.size();
    for (std::size_t i = 0; i < count && features.size() < features.capacity(); ++i) {
      const float* k = &given_.keypoints[5 * i];
      const int slot = features.Append({k[0], k[1], k[2], k[3], k[4], 1, given_.laplacian_sign[i]});
      const auto descriptor = given_.descriptors.subspan(i * std::size_t(dim_), dim_);
      std::copy(descriptor.begin(), descriptor.end(), features.mutable_descriptor(slot).begin());
    }
    return {};
  }

 private:
  int dim_;
  std::uint32_t version_;
  GoldenFeatures given_;
};

GoldenLocalizer::GoldenLocalizer(Localizer localizer, Extractor* extractor)
    : localizer_(std::move(localizer)), extractor_(extractor) {}

Result<GoldenLocalizer> GoldenLocalizer::Create(const ModelView& model) {
  auto extractor = std::make_unique<Extractor>(model.features());
  Extractor* const borrowed = extractor.get();
  Result<Localizer> localizer = Localizer::Create(model, {}, std::move(extractor));
  if (!localizer.ok()) return localizer.status();
  return GoldenLocalizer(std::move(*localizer), borrowed);
}

Result<Fix> GoldenLocalizer::Localize(const GoldenFeatures& features) {
  extractor_->Give(features);
  blank_.assign(std::size_t(features.width) * features.height, 0);
  return localizer_.Localize({blank_.data(), features.width, features.height, features.width});
}

GoldenFeatures GoldenQueryAt(const ModelView& model, int query_idx) {
  const ModelGolden& g = model.golden();
  const std::size_t begin = g.begin[query_idx];
  const std::size_t count = g.begin[query_idx + 1] - begin;
  const std::size_t dim = model.features().descriptor_dim;
  return {g.width[query_idx], g.height[query_idx], g.keypoints.subspan(5 * begin, 5 * count),
          g.laplacian_sign.subspan(begin, count), g.descriptors.subspan(dim * begin, dim * count)};
}

Status SelfTest(const ModelView& model) {
  // That this build finds the model's features at all, which stored ones do not show.
  if (const auto whole = Localizer::Create(model, {}); !whole.ok()) return whole.status();
  if (model.golden().size == 0) return {};
  Result<GoldenLocalizer> localizer = GoldenLocalizer::Create(model);
  if (!localizer.ok()) return localizer.status();
  for (int i = 0; i < model.golden().size; ++i) {
    const Result<Fix> fix = localizer->Localize(GoldenQueryAt(model, i));
    if (!fix.ok()) return fix.status();
    const bool right =
        fix->localized && fix->level == 0 && fix->pair_idx == model.golden().pair[i] &&
        fix->has_pose == (model.golden().has_pose[i] != 0) &&
        (!fix->has_pose ||
         SamePose(fix->world_from_cam, model.golden().pose.subspan(7 * std::size_t(i), 7)));
    if (!right) {
      return {StatusCode::kUnsupported,
              "the model's self-test failed: this program sees it otherwise",
              "golden query " + std::to_string(i)};
    }
  }
  return {};
}

}  // namespace viewfix
