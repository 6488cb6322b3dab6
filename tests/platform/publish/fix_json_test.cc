// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "platform/publish/fix_writer.h"
#include "tests/testing/tiny_model.h"

namespace viewfix {
namespace {

// The keys that clients rely on, in no order.
constexpr const char* kKeys[] = {"schema",   "seq",    "capture_time_ns", "time",       "age_ms",
                                 "model",    "state",  "location",        "level",      "view",
                                 "score",    "margin", "rivals",          "confidence", "inliers",
                                 "keyframe", "pose",   "reasons",         "ms"};

TEST(FixJsonTest, EveryLineHoldsEveryKey) {
  const std::vector<std::uint8_t> bytes = TinyModel();
  const ModelView model = *ModelView::Open(bytes);
  FixWriter writer(model);
  for (const bool localized : {false, true}) {
    const Fix fix = {.localized = localized,
                     .reasons = kUnknownPlace,
                     .location_idx = 0,
                     .pair_idx = 0,
                     .keyframe_idx = 0,
                     .confidence = 1.0F / 3,
                     .ms = {}};
    const auto json = nlohmann::json::parse(writer.Write({1, 2, 3, 4}, fix));
    EXPECT_EQ(json.size(), std::size(kKeys));
    for (const char* key : kKeys) EXPECT_TRUE(json.contains(key)) << key;
    for (const char* stage : {"features", "score", "verify", "pose", "total"}) {
      EXPECT_TRUE(json["ms"].contains(stage)) << stage;
    }
    EXPECT_EQ(json["location"].is_null(), !localized);
    EXPECT_EQ(json["keyframe"].is_null(), !localized);
    EXPECT_EQ(json["confidence"].get<float>(), 1.0F / 3);
  }
}

TEST(FixJsonTest, APoseHasEveryKeyAndTwentyOneNumbers) {
  const std::vector<std::uint8_t> bytes = TinyModel();
  const ModelView model = *ModelView::Open(bytes);
  FixWriter writer(model);
  Fix fix;
  fix.localized = fix.has_pose = true;
  fix.location_idx = fix.pair_idx = fix.keyframe_idx = fix.map_idx = 0;
  fix.world_from_cam.rotation = Eigen::Quaterniond(0.5, 0.1, -0.7, 0.2).normalized();
  fix.world_from_cam.translation = Eigen::Vector3d(1.0 / 3, -2e-7, 3e5);
  fix.covariance = Eigen::Matrix<double, 6, 6>::Constant(1e-5);
  const auto pose = nlohmann::json::parse(writer.Write({1, 2, 3, 4}, fix))["pose"];
  EXPECT_EQ(pose.size(), 6U);
  EXPECT_EQ(pose["frame"], "world_from_cam");
  EXPECT_EQ(pose["metric"], true);
  EXPECT_EQ(pose["covariance"].size(), 21U);
  EXPECT_EQ(pose["covariance"][20].get<float>(), 1e-5F);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(pose["t"][i].get<float>(), static_cast<float>(fix.world_from_cam.translation[i]));
  }
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(pose["q_xyzw"][i].get<float>(),
              static_cast<float>(fix.world_from_cam.rotation.coeffs()[i]));
  }
}

TEST(FixJsonTest, AnyStringParses) {
  std::string all;
  for (int c = 0; c < 256; ++c) all.push_back(static_cast<char>(c));
  JsonLine line;
  line.String(all);
  EXPECT_EQ(nlohmann::json::parse(line.text()).get<std::string>().substr(0, 128),
            all.substr(0, 128));
}

}  // namespace
}  // namespace viewfix
