// SPDX-License-Identifier: BSD-3-Clause
#include "platform/store/golden.h"

#include <gmock/gmock.h>

#include <cmath>

#include "models/model_writer.h"
#include "tests/testing/landmark_site.h"

namespace viewfix {
namespace {

std::vector<std::uint8_t> Written(const ModelData& data) {
  const auto bytes = WriteModel(data);
  EXPECT_TRUE(bytes.ok()) << bytes.status().text();
  return *bytes;
}

// The site's photograph as a golden query, answered by the localizer that finds its own features.
ModelData SiteWithGolden() {
  LandmarkSite site = MakeLandmarkSite();
  const auto bytes = Written(site.data);
  const Result<ModelView> model = ModelView::Open(bytes);
  Result<Localizer> localizer = Localizer::Create(*model, {});
  EXPECT_TRUE(localizer.ok());
  const ImageView image = {site.pixels.data(), site.width, site.height, site.width};
  const Result<Fix> fix = localizer->Localize(image);
  EXPECT_TRUE(fix.ok() && fix->localized && fix->has_pose);

  const ModelFeatures& f = model->features();
  auto extractor = CreateFeatureExtractor({.type = static_cast<FeatureType>(f.type),
                                           .max_image_side = f.max_image_side,
                                           .max_features = f.max_features,
                                           .upright = f.upright,
                                           .threshold = f.threshold});
  FeatureSet features(f.max_features, f.descriptor_dim);
  EXPECT_TRUE((*extractor)->Extract(image, features).ok());
  ModelData::GoldenData& golden = site.data.golden;
  golden.width = {static_cast<std::uint16_t>(site.width)};
  golden.height = {static_cast<std::uint16_t>(site.height)};
  golden.begin = {0, static_cast<std::uint32_t>(features.size())};
  for (const Keypoint& k : features.keypoints()) {
    golden.keypoints.insert(golden.keypoints.end(), {k.x, k.y, k.sigma, k.cos_angle, k.sin_angle});
    golden.laplacian_sign.push_back(k.laplacian_sign);
  }
  golden.descriptors.assign(features.descriptors().begin(), features.descriptors().end());
  golden.pair = {static_cast<std::uint16_t>(fix->pair_idx)};
  golden.has_pose = {1};
  const Eigen::Vector3f t = fix->world_from_cam.translation.cast<float>();
  const Eigen::Quaternionf q = fix->world_from_cam.rotation.cast<float>();
  golden.pose = {{t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}};
  return site.data;
}

Status Tested(const ModelData& data) {
  const auto bytes = Written(data);
  const Result<ModelView> model = ModelView::Open(bytes);
  return SelfTest(*model);
}

TEST(GoldenTest, StoredFeaturesGiveTheSameFix) {
  const Status status = Tested(SiteWithGolden());
  EXPECT_TRUE(status.ok()) << status.text();
}

TEST(GoldenTest, AnotherAnswerFailsTheSelfTest) {
  ModelData data = SiteWithGolden();
  data.golden.pair[0] = data.golden.pair[0] == 0 ? 1 : 0;
  EXPECT_EQ(Tested(data).code(), StatusCode::kUnsupported);
  data = SiteWithGolden();
  data.golden.pose[0][0] += 0.1F;
  EXPECT_EQ(Tested(data).code(), StatusCode::kUnsupported);
  data = SiteWithGolden();
  data.golden.has_pose[0] = 0;
  EXPECT_EQ(Tested(data).code(), StatusCode::kUnsupported);
}

TEST(GoldenTest, FeaturesThatThisBuildDoesNotFindFailIt) {
  ModelData data = MakeLandmarkSite().data;
  data.features.version += 1;
  EXPECT_EQ(Tested(data).code(), StatusCode::kUnsupported);
}

TEST(GoldenTest, AModelWithoutQueriesPasses) { EXPECT_TRUE(Tested(MakeLandmarkSite().data).ok()); }

TEST(GoldenTest, BrokenQueriesAreRefusedByTheReader) {
  using Break = void (*)(ModelData::GoldenData&);
  for (const Break breaks : std::initializer_list<Break>{
           [](auto& g) { g.begin[1] += 1; }, [](auto& g) { g.begin[0] = 1; },
           [](auto& g) { g.width[0] = 0; }, [](auto& g) { g.height[0] = 60000; },
           [](auto& g) { g.pair[0] = 60000; }, [](auto& g) { g.has_pose[0] = 2; },
           [](auto& g) { g.pose[0][6] = 9; }, [](auto& g) { g.keypoints[3] = NAN; },
           [](auto& g) { g.keypoints.pop_back(); }, [](auto& g) { g.laplacian_sign[2] = 5; },
           [](auto& g) { g.descriptors.pop_back(); }, [](auto& g) { g.pose.clear(); }}) {
    ModelData data = SiteWithGolden();
    breaks(data.golden);
    EXPECT_FALSE(WriteModel(data).ok());
  }
}

}  // namespace
}  // namespace viewfix
