// SPDX-License-Identifier: BSD-3-Clause
#include "engine/viewfix.h"

#include <gmock/gmock.h>

#include <cstddef>
#include <cstring>
#include <memory>
#include <string>

#include "engine/localizer.h"
#include "tests/testing/jpeg_encoder.h"
#include "tests/testing/landmark_site.h"
#include "tests/testing/tiny_model.h"

namespace viewfix {
namespace {

using testing::HasSubstr;

constexpr int kWidth = 200;
constexpr int kHeight = 150;

struct Freer {
  void operator()(viewfix_localizer* localizer) const { viewfix_free(localizer); }
};

class CApiTest : public testing::Test {
 protected:
  void SetUp() override {
    char error[64] = "unset";
    viewfix_localizer* opened = nullptr;
    ASSERT_EQ(viewfix_open(bytes_.data(), bytes_.size(), &opened, error, sizeof error), VIEWFIX_OK);
    EXPECT_STREQ(error, "");
    localizer_.reset(opened);
  }
  viewfix_status Localize(const std::vector<std::uint8_t>& pixels, viewfix_fix& fix) {
    return viewfix_localize(localizer_.get(), pixels.data(), kWidth, kHeight, kWidth, &fix);
  }

  const std::vector<std::uint8_t> bytes_ = TinyModel();
  const std::vector<std::uint8_t> texture_ = MakeTexture(kWidth, kHeight, 1);
  std::unique_ptr<viewfix_localizer, Freer> localizer_;
};

TEST_F(CApiTest, AgreesWithTheEngine) {
  const ModelView model = *ModelView::Open(bytes_);
  Localizer engine = std::move(*Localizer::Create(model, {}));
  for (std::uint32_t seed = 0; seed < 4; ++seed) {
    const std::vector<std::uint8_t> pixels = MakeTexture(kWidth, kHeight, seed);
    const Fix expected = *engine.Localize({pixels.data(), kWidth, kHeight, kWidth});
    viewfix_fix fix = {};
    fix.size = sizeof fix;
    ASSERT_EQ(Localize(pixels, fix), VIEWFIX_OK);
    ASSERT_EQ(fix.localized, 1);
    EXPECT_EQ(fix.location, model.location_name(expected.location_idx));
    EXPECT_EQ(fix.view, model.view_name(model.scoring().pair_view[expected.pair_idx]));
    EXPECT_EQ(fix.reasons, expected.reasons);
    EXPECT_EQ(fix.confidence, expected.confidence);
    EXPECT_EQ(fix.score, expected.score);
    EXPECT_EQ(fix.margin, expected.margin);
    EXPECT_EQ(fix.keyframe_id, expected.keyframe_idx);
    EXPECT_EQ(fix.keyframe_has_pose, model.keyframes().has_pose[expected.keyframe_idx]);
    EXPECT_EQ(fix.keyframe_pose[1], model.keyframes().pose[expected.keyframe_idx * 7 + 1]);
    EXPECT_EQ(fix.pose_valid, 0);
    EXPECT_EQ(fix.level, 2);
    ASSERT_EQ(fix.num_rivals, expected.num_rivals);
    for (int i = 0; i < fix.num_rivals; ++i) {
      EXPECT_EQ(fix.rivals[i], model.location_name(expected.rivals[i]));
    }
  }
}

// Two areas that score alike on one floor, and a far worse one on another.
TEST(CApiLevelTest, AFloorMayBeAllThatIsSaid) {
  ModelData data = TinyModelData();
  data.locations = {"floor1/hall", "floor1/lobby", "floor2/lift", "floor2/stair"};
  data.pair_location = {0, 1, 2, 3};
  data.pair_view = {0, 0, 0, 0};
  data.views = {"left"};
  data.bias = {1, 1, -2, -2};
  data.weight_scale.assign(4, 1e-6F);
  data.confidence = {.offset = -1, .slope = 2, .threshold = 0.5F};
  const auto bytes = *WriteModel(data);
  viewfix_localizer* opened = nullptr;
  ASSERT_EQ(viewfix_open(bytes.data(), bytes.size(), &opened, nullptr, 0), VIEWFIX_OK);
  const std::unique_ptr<viewfix_localizer, Freer> localizer(opened);
  const std::vector<std::uint8_t> texture = MakeTexture(kWidth, kHeight, 1);
  viewfix_fix fix = {};
  fix.size = sizeof fix;
  ASSERT_EQ(viewfix_localize(opened, texture.data(), kWidth, kHeight, kWidth, &fix), VIEWFIX_OK);
  ASSERT_EQ(fix.localized, 1);
  EXPECT_STREQ(fix.location, "floor1");
  EXPECT_EQ(fix.level, 1);
  EXPECT_EQ(fix.view, nullptr);
  EXPECT_EQ(fix.keyframe_id, -1);
  ASSERT_EQ(fix.num_rivals, 2);
  EXPECT_STRNE(fix.rivals[0], fix.rivals[1]);
  for (const char* rival : {fix.rivals[0], fix.rivals[1]}) {
    EXPECT_THAT(rival, testing::StartsWith("floor1/"));
  }
}

TEST_F(CApiTest, RowsMayBeApart) {
  const int row_bytes = kWidth + 13;
  std::vector<std::uint8_t> padded(std::size_t(row_bytes) * kHeight, 255);
  for (int y = 0; y < kHeight; ++y) {
    std::memcpy(&padded[std::size_t(y) * row_bytes], &texture_[std::size_t(y) * kWidth], kWidth);
  }
  viewfix_fix dense = {};
  viewfix_fix apart = {};
  dense.size = apart.size = sizeof dense;
  ASSERT_EQ(Localize(texture_, dense), VIEWFIX_OK);
  ASSERT_EQ(viewfix_localize(localizer_.get(), padded.data(), kWidth, kHeight, row_bytes, &apart),
            VIEWFIX_OK);
  EXPECT_EQ(apart.score, dense.score);
  EXPECT_EQ(apart.keyframe_id, dense.keyframe_id);
}

TEST_F(CApiTest, ColoursCount) {
  ModelData data = TinyModelData();
  data.features.type = static_cast<std::uint8_t>(FeatureType::kColorSurf);
  const int words = static_cast<int>(data.words.size()) / data.features.descriptor_dim;
  std::vector<std::int8_t> longer;
  for (int w = 0; w < words; ++w) {
    longer.insert(longer.end(), data.words.begin() + w * 64, data.words.begin() + (w + 1) * 64);
    longer.insert(longer.end(), 8, static_cast<std::int8_t>(w % 2 == 0 ? 90 : -90));
  }
  data.words = longer;
  data.features.descriptor_dim = 72;
  const auto bytes = *WriteModel(data);
  viewfix_localizer* opened = nullptr;
  char error[200];
  ASSERT_EQ(viewfix_open(bytes.data(), bytes.size(), &opened, error, sizeof error), VIEWFIX_OK)
      << error;
  const std::unique_ptr<viewfix_localizer, Freer> localizer(opened);
  viewfix_image image = {sizeof image, texture_.data(), kWidth, kHeight, kWidth,
                         nullptr,      nullptr,         0,      0,       0};
  viewfix_fix grey = {}, plain = {}, colour = {};
  grey.size = plain.size = colour.size = sizeof grey;
  ASSERT_EQ(viewfix_localize(opened, texture_.data(), kWidth, kHeight, kWidth, &grey), VIEWFIX_OK);
  ASSERT_EQ(viewfix_localize_image(opened, &image, &plain), VIEWFIX_OK);
  EXPECT_EQ(plain.score, grey.score);
  const std::vector<std::uint8_t> cb = MakeTexture(kWidth / 2, kHeight / 2, 2);
  image.cb = image.cr = cb.data();
  image.chroma_width = kWidth / 2;
  image.chroma_height = kHeight / 2;
  image.chroma_row_bytes = kWidth / 2;
  ASSERT_EQ(viewfix_localize_image(opened, &image, &colour), VIEWFIX_OK);
  EXPECT_NE(colour.score, grey.score);
  image.chroma_row_bytes -= 1;
  EXPECT_EQ(viewfix_localize_image(opened, &image, &colour), VIEWFIX_INVALID_ARGUMENT);
  image.chroma_row_bytes = SIZE_MAX;
  EXPECT_EQ(viewfix_localize_image(opened, &image, &colour), VIEWFIX_INVALID_ARGUMENT);
  image.size = 8;
  EXPECT_EQ(viewfix_localize_image(opened, &image, &colour), VIEWFIX_INVALID_ARGUMENT);
  EXPECT_EQ(viewfix_localize_image(opened, nullptr, &colour), VIEWFIX_INVALID_ARGUMENT);
}

TEST_F(CApiTest, NotKnowingIsAnAnswer) {
  viewfix_fix fix = {};
  fix.size = sizeof fix;
  ASSERT_EQ(Localize(std::vector<std::uint8_t>(kWidth * kHeight, 99), fix), VIEWFIX_OK);
  EXPECT_EQ(fix.localized, 0);
  EXPECT_EQ(fix.reasons, std::uint32_t{VIEWFIX_TOO_FEW_FEATURES});
  EXPECT_EQ(fix.location, nullptr);
  EXPECT_EQ(fix.view, nullptr);
  EXPECT_EQ(fix.keyframe_id, -1);
}

// A caller built against a newer header has a longer struct: the rest stays as it was.
TEST_F(CApiTest, WritesNoMoreThanItKnows) {
  struct Newer {
    viewfix_fix fix;
    int added;
  } newer = {{}, 42};
  newer.fix.size = sizeof newer;
  ASSERT_EQ(Localize(texture_, newer.fix), VIEWFIX_OK);
  EXPECT_EQ(newer.fix.size, sizeof newer);
  EXPECT_EQ(newer.added, 42);
}

TEST_F(CApiTest, RefusesWrongArguments) {
  viewfix_fix fix = {};
  fix.size = sizeof fix;
  fix.score = 7;
  const std::uint8_t* pixels = texture_.data();
  viewfix_localizer* const localizer = localizer_.get();
  EXPECT_EQ(viewfix_localize(nullptr, pixels, 4, 4, 4, &fix), VIEWFIX_INVALID_ARGUMENT);
  EXPECT_EQ(viewfix_localize(localizer, nullptr, 4, 4, 4, &fix), VIEWFIX_INVALID_ARGUMENT);
  EXPECT_EQ(viewfix_localize(localizer, pixels, 4, 4, 4, nullptr), VIEWFIX_INVALID_ARGUMENT);
  EXPECT_EQ(viewfix_localize(localizer, pixels, 0, 4, 4, &fix), VIEWFIX_INVALID_ARGUMENT);
  EXPECT_EQ(viewfix_localize(localizer, pixels, 4, -1, 4, &fix), VIEWFIX_INVALID_ARGUMENT);
  EXPECT_EQ(viewfix_localize(localizer, pixels, 4, 4, 3, &fix), VIEWFIX_INVALID_ARGUMENT);
  EXPECT_EQ(viewfix_localize(localizer, pixels, 4, 4, SIZE_MAX, &fix), VIEWFIX_INVALID_ARGUMENT);
  EXPECT_EQ(viewfix_localize(localizer, pixels, 20000, 1, 20000, &fix), VIEWFIX_INVALID_ARGUMENT);
  EXPECT_EQ(fix.score, 7);
  fix.size = 0;
  EXPECT_EQ(Localize(texture_, fix), VIEWFIX_INVALID_ARGUMENT);
}

TEST(CApiPoseTest, AgreesWithTheEngine) {
  const LandmarkSite site = MakeLandmarkSite();
  const std::vector<std::uint8_t> bytes = *WriteModel(site.data);
  Localizer engine = std::move(*Localizer::Create(*ModelView::Open(bytes), {}));
  const Fix expected = *engine.Localize({site.pixels.data(), site.width, site.height, site.width});
  ASSERT_TRUE(expected.has_pose);
  viewfix_localizer* opened = nullptr;
  ASSERT_EQ(viewfix_open(bytes.data(), bytes.size(), &opened, nullptr, 0), VIEWFIX_OK);
  const std::unique_ptr<viewfix_localizer, Freer> localizer(opened);
  viewfix_fix fix = {};
  fix.size = sizeof fix;
  ASSERT_EQ(viewfix_localize(opened, site.pixels.data(), site.width, site.height,
                             static_cast<std::size_t>(site.width), &fix),
            VIEWFIX_OK);
  EXPECT_EQ(fix.localized, 1);
  EXPECT_EQ(fix.pose_valid, 1);
  EXPECT_EQ(fix.pose_map, expected.map_idx);
  EXPECT_EQ(fix.inliers, expected.num_inliers);
  EXPECT_EQ(fix.keyframe_id, expected.keyframe_idx);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(fix.pose[i], expected.world_from_cam.translation[i]);
  EXPECT_EQ(fix.pose[3], expected.world_from_cam.rotation.x());
  EXPECT_EQ(fix.pose[6], expected.world_from_cam.rotation.w());
  EXPECT_EQ(fix.covariance[0], static_cast<float>(expected.covariance(0, 0)));
  EXPECT_EQ(fix.covariance[5], static_cast<float>(expected.covariance(0, 5)));
  EXPECT_EQ(fix.covariance[6], static_cast<float>(expected.covariance(1, 1)));
  EXPECT_EQ(fix.covariance[20], static_cast<float>(expected.covariance(5, 5)));
}

// A caller built against the first header, whose struct ended with pose_valid.
TEST(CApiPoseTest, AnOlderCallersMemoryIsLeftAlone) {
  const LandmarkSite site = MakeLandmarkSite();
  const std::vector<std::uint8_t> bytes = *WriteModel(site.data);
  viewfix_localizer* opened = nullptr;
  ASSERT_EQ(viewfix_open(bytes.data(), bytes.size(), &opened, nullptr, 0), VIEWFIX_OK);
  const std::unique_ptr<viewfix_localizer, Freer> localizer(opened);
  viewfix_fix fix = {};
  fix.size = offsetof(viewfix_fix, pose_valid) + sizeof(std::int32_t);
  fix.pose[0] = 42;
  fix.inliers = -7;
  ASSERT_EQ(viewfix_localize(opened, site.pixels.data(), site.width, site.height,
                             static_cast<std::size_t>(site.width), &fix),
            VIEWFIX_OK);
  EXPECT_EQ(fix.pose_valid, 1);
  EXPECT_EQ(fix.pose[0], 42);
  EXPECT_EQ(fix.inliers, -7);
  fix.size -= 1;
  EXPECT_EQ(viewfix_localize(opened, site.pixels.data(), site.width, site.height,
                             static_cast<std::size_t>(site.width), &fix),
            VIEWFIX_INVALID_ARGUMENT);
}

TEST(CApiOpenTest, RefusesWrongArguments) {
  const std::vector<std::uint8_t> bytes = TinyModel();
  viewfix_localizer* opened = nullptr;
  EXPECT_EQ(viewfix_open(nullptr, 9, &opened, nullptr, 0), VIEWFIX_INVALID_ARGUMENT);
  EXPECT_EQ(viewfix_open(bytes.data(), bytes.size(), nullptr, nullptr, 0),
            VIEWFIX_INVALID_ARGUMENT);
  viewfix_free(nullptr);
}

TEST(CApiOpenTest, SaysWhatIsWrongInTheRoomThereIs) {
  std::vector<std::uint8_t> bytes = TinyModel();
  bytes.back() ^= 1;
  char error[8];
  std::memset(error, 'x', sizeof error);
  viewfix_localizer* opened = reinterpret_cast<viewfix_localizer*>(&bytes);
  EXPECT_EQ(viewfix_open(bytes.data(), bytes.size(), &opened, error, sizeof error),
            VIEWFIX_CORRUPT);
  EXPECT_EQ(opened, nullptr);
  EXPECT_EQ(std::strlen(error), sizeof error - 1);
  EXPECT_EQ(viewfix_open(bytes.data(), bytes.size(), &opened, nullptr, 0), VIEWFIX_CORRUPT);
}

TEST(CApiOpenTest, RefusesFeaturesItCannotMake) {
  ModelData data = TinyModelData();
  ++data.features.version;
  const std::vector<std::uint8_t> bytes = *WriteModel(data);
  char error[200];
  viewfix_localizer* opened = nullptr;
  EXPECT_EQ(viewfix_open(bytes.data(), bytes.size(), &opened, error, sizeof error),
            VIEWFIX_UNSUPPORTED);
  EXPECT_THAT(error, HasSubstr("features"));
}

TEST(CApiNamesTest, AreThere) {
  EXPECT_STREQ(viewfix_version(), VIEWFIX_VERSION);
  EXPECT_STREQ(viewfix_status_name(VIEWFIX_OK), "ok");
  EXPECT_STREQ(viewfix_status_name(static_cast<viewfix_status>(7)), "unknown");
  EXPECT_STREQ(viewfix_reason_name(VIEWFIX_AMBIGUOUS), "ambiguous");
  EXPECT_STREQ(viewfix_reason_name(VIEWFIX_LOW_INLIERS), "low_inliers");
  EXPECT_STREQ(viewfix_reason_name(VIEWFIX_BLURRED), "blurred");
  EXPECT_STREQ(viewfix_reason_name(VIEWFIX_DARK), "dark");
  EXPECT_STREQ(viewfix_reason_name(VIEWFIX_OVEREXPOSED), "overexposed");
  EXPECT_STREQ(viewfix_reason_name(1U << 31), "");
}

}  // namespace
}  // namespace viewfix
