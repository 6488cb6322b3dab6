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
