// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/experiment/results.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace viewfix {
namespace {

TEST(BootstrapShare, AllRightHasNoWidth) {
  const Share share = BootstrapShare({{true, true}, {true}});
  EXPECT_EQ(share.mean, 1);
  EXPECT_EQ(share.ci95.low, 1);
  EXPECT_EQ(share.ci95.high, 1);
}

TEST(BootstrapShare, IsAboutTheBinomialIntervalForOneSplit) {
  std::vector<bool> right(100, true);
  for (int i = 0; i < 20; ++i) right[i] = false;
  const Share share = BootstrapShare({right});
  EXPECT_NEAR(share.mean, 0.8, 1e-12);
  EXPECT_NEAR(share.ci95.low, 0.72, 0.02);
  EXPECT_NEAR(share.ci95.high, 0.88, 0.02);
}

TEST(BootstrapShare, SplitsWithoutImagesDoNotCount) {
  EXPECT_EQ(BootstrapShare({{}, {true}}).mean, 1);
  EXPECT_EQ(BootstrapShare({{}}).mean, 0);
}

}  // namespace
}  // namespace viewfix
