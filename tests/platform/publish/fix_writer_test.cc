// SPDX-License-Identifier: BSD-3-Clause
#include "platform/publish/fix_writer.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <climits>
#include <limits>

#include "tests/testing/tiny_model.h"

namespace viewfix {
namespace {

using testing::HasSubstr;

class FixWriterTest : public testing::Test {
 protected:
  // 2026-05-04 03:02:01.005 UTC
  static constexpr FrameTimes kTimes = {7, 123456789, 1'777'863'721'005'000'000, 2'500'000};

  static Fix Localized() {
    Fix fix;
    fix.localized = true;
    fix.location_idx = 0;
    fix.pair_idx = 1;
    fix.keyframe_idx = 2;
    fix.confidence = 0.75F;
    fix.score = 1.5F;
    fix.margin = 0.1F;
    fix.num_rivals = 1;
    fix.rivals[0] = 1;
    fix.ms = {1.25F, 0.5F, 0, 0, 1.75F};
    return fix;
  }

  std::string Write(const Fix& fix) { return std::string(writer_.Write(kTimes, fix)); }
  std::string ModelName() const {
    const auto hash = model_.short_hash();
    return {hash.data(), hash.size()};
  }

  const std::vector<std::uint8_t> bytes_ = TinyModel();
  const ModelView model_ = *ModelView::Open(bytes_);
  FixWriter writer_{model_};
};

TEST_F(FixWriterTest, WritesALocalizedFrame) {
  EXPECT_EQ(
      Write(Localized()),
      "{\"schema\":1,\"seq\":7,\"capture_time_ns\":123456789,\"time\":\"2026-05-04T03:02:01.005Z\","
      "\"age_ms\":2.5,\"model\":\"" +
          ModelName() +
          "\",\"state\":\"localized\","
          "\"location\":\"floor1/caf\xC3\xA9\",\"level\":2,\"view\":\"right\",\"confidence\":0.75,"
          "\"score\":1.5,\"margin\":0.1,\"rivals\":[\"floor1/lobby\"],\"inliers\":0,"
          "\"keyframe\":{\"id\":2,\"pose\":{\"frame\":\"world_from_cam\",\"map\":0,\"metric\":true,"
          "\"t\":[0.2,-1.5,2],\"q_xyzw\":[0,0.6,0,0.8]}},\"pose\":null,\"reasons\":[],"
          "\"ms\":{\"features\":1.25,\"score\":0.5,\"verify\":0,\"pose\":0,\"total\":1.75}}\n");
}

TEST_F(FixWriterTest, ARefusalNamesNoPlace) {
  Fix fix = Localized();
  fix.localized = false;
  fix.reasons = kAmbiguous | kTooFewFeatures;
  const std::string line = Write(fix);
  EXPECT_THAT(line, HasSubstr("\"state\":\"not_localized\",\"location\":null,\"level\":0,"
                              "\"view\":null"));
  EXPECT_THAT(line, HasSubstr("\"keyframe\":null,\"pose\":null"));
  EXPECT_THAT(line, HasSubstr("\"reasons\":[\"too_few_features\",\"ambiguous\"]"));
  EXPECT_THAT(line, HasSubstr("\"rivals\":[\"floor1/caf\xC3\xA9\",\"floor1/lobby\"]"))
      << "between what it is ambiguous";
  fix.reasons = kLowInliers | kDark | kBlurred | kOverexposed | kUnknownPlace;
  const std::string other = Write(fix);
  EXPECT_THAT(other, HasSubstr("\"reasons\":[\"blurred\",\"dark\",\"overexposed\","
                               "\"unknown_place\",\"low_inliers\"]"));
  EXPECT_THAT(other, HasSubstr("\"rivals\":[\"floor1/lobby\"]"));
}

TEST_F(FixWriterTest, AFloorAloneHasNeitherViewNorKeyframe) {
  Fix fix = Localized();
  fix.level = 1;
  fix.reasons = kAmbiguous;
  const std::string line = Write(fix);
  EXPECT_THAT(line, HasSubstr("\"state\":\"localized\",\"location\":\"floor1\",\"level\":1,"
                              "\"view\":null"));
  EXPECT_THAT(line, HasSubstr("\"rivals\":[\"floor1/caf\xC3\xA9\",\"floor1/lobby\"]"));
  EXPECT_THAT(line, HasSubstr("\"keyframe\":null,\"pose\":null"));
}

TEST_F(FixWriterTest, AKeyframeWithoutPoseSaysSo) {
  Fix fix = Localized();
  fix.keyframe_idx = 3;
  EXPECT_THAT(Write(fix), HasSubstr("\"keyframe\":{\"id\":3,\"pose\":null}"));
  fix.keyframe_idx = -1;
  EXPECT_THAT(Write(fix), HasSubstr("\"keyframe\":null"));
}

// Exact numbers, so that the text is known: the upper triangle, row by row.
TEST_F(FixWriterTest, WritesAPoseWithItsCovariance) {
  Fix fix = Localized();
  fix.has_pose = true;
  fix.map_idx = 3;
  fix.world_from_cam = {Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), Eigen::Vector3d(1.5, -2, 0.25)};
  for (int row = 0; row < 6; ++row) {
    for (int col = 0; col < 6; ++col) {
      fix.covariance(row, col) = 10 * std::min(row, col) + std::max(row, col);
    }
  }
  fix.num_inliers = 41;
  const std::string line = Write(fix);
  EXPECT_THAT(line, HasSubstr("\"inliers\":41,"));
  EXPECT_THAT(line,
              HasSubstr(",\"pose\":{\"frame\":\"world_from_cam\",\"map\":3,\"metric\":true,"
                        "\"t\":[1.5,-2,0.25],\"q_xyzw\":[-0.5,0.5,-0.5,0.5],"
                        "\"covariance\":[0,1,2,3,4,5,11,12,13,14,15,22,23,24,25,33,34,35,44,45,55]}"
                        ",\"reasons\":"));
}

TEST_F(FixWriterTest, NumbersThatAreNotFiniteAreNull) {
  Fix fix = Localized();
  fix.score = std::numeric_limits<float>::quiet_NaN();
  fix.margin = -std::numeric_limits<float>::infinity();
  EXPECT_THAT(Write(fix), HasSubstr("\"score\":null,\"margin\":null"));
}

TEST_F(FixWriterTest, TheSameFixGivesTheSameLine) {
  const std::string first = Write(Localized());
  Fix other = Localized();
  other.localized = false;
  EXPECT_NE(Write(other), first);
  EXPECT_EQ(Write(Localized()), first);
}

TEST_F(FixWriterTest, TimesAreUtc) {
  const auto time_of = [&](std::int64_t utc_ns) {
    return std::string(writer_.Write({0, 0, utc_ns, 0}, {}));
  };
  EXPECT_THAT(time_of(0), HasSubstr("\"1970-01-01T00:00:00.000Z\""));
  EXPECT_THAT(time_of(1'709'251'199'999'999'999), HasSubstr("\"2024-02-29T23:59:59.999Z\""));
}

TEST(JsonLineTest, StringsAreEscaped) {
  const auto written = [](std::string_view text) {
    JsonLine line;
    line.String(text);
    return std::string(line.text());
  };
  EXPECT_EQ(written("a/b"), "\"a/b\"");
  EXPECT_EQ(written("\"\\\n\x1f"), "\"\\\"\\\\\\u000a\\u001f\"");
  EXPECT_EQ(written("caf\xC3\xA9 \xF0\x9F\x98\x80"), "\"caf\xC3\xA9 \xF0\x9F\x98\x80\"");
  EXPECT_EQ(written("\xFF"
                    "a\xC3"),
            "\"\xEF\xBF\xBD"
            "a\xEF\xBF\xBD\"");
}

TEST(JsonLineTest, FloatsReadBackTheSame) {
  for (const float value : {0.1F, 1.0F / 3, -1e-38F, 3e38F, 16777217.0F, 1e-45F}) {
    JsonLine line;
    line.Float(value);
    EXPECT_EQ(std::strtof(std::string(line.text()).c_str(), nullptr), value);
  }
}

TEST(JsonLineTest, NeverOverflows) {
  JsonLine line;
  const std::string text(1000, '\x01');
  for (int i = 0; i < 10; ++i) line.String(text);
  EXPECT_EQ(line.text().size(), JsonLine::kCapacity);
}

// The longest names that a model can hold, all to be escaped.
TEST(FixWriterSizeTest, TheLongestFixFits) {
  ModelData data = TinyModelData();
  data.locations.clear();
  data.pair_location.clear();
  for (std::uint16_t l = 0; l < 6; ++l) {
    data.locations.push_back(std::string(254, '\x01') + static_cast<char>('a' + l));
    data.pair_location.push_back(l);
  }
  data.views = {std::string(255, '\x02')};
  data.pair_view.assign(6, 0);
  data.bias.assign(6, 0);
  data.weight_scale.assign(6, 0);
  data.weights.resize(data.weights.size() / 4 * 6);
  const auto bytes = WriteModel(data);
  ASSERT_TRUE(bytes.ok()) << bytes.status().text();
  const ModelView model = *ModelView::Open(*bytes);
  Fix fix = {.localized = true,
             .reasons = ~0U,
             .location_idx = 0,
             .pair_idx = 0,
             .keyframe_idx = 0,
             .confidence = -1.17549435e-38F,
             .score = -1.17549435e-38F,
             .margin = -1.17549435e-38F,
             .num_rivals = Fix::kMaxRivals,
             .rivals = {1, 2, 3, 4},
             .ms = {}};
  fix.has_pose = true;
  fix.map_idx = INT_MIN;
  fix.world_from_cam.translation.setConstant(-1.17549435e-38);
  fix.world_from_cam.rotation.coeffs().setConstant(-1.17549435e-38);
  fix.covariance.setConstant(-1.17549435e-38);
  FixWriter writer(model);
  const auto line = writer.Write({~0ULL >> 1, INT64_MAX, INT64_MAX, INT64_MAX}, fix);
  EXPECT_EQ(line.back(), '\n');
  EXPECT_LT(line.size(), JsonLine::kCapacity);
}

}  // namespace
}  // namespace viewfix
