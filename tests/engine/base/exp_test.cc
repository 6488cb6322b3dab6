// SPDX-License-Identifier: BSD-3-Clause
#include "engine/base/exp.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace viewfix {
namespace {

TEST(Exp, AgreesWithLibm) {
  for (double x = -690; x <= 690; x += 0.37) {
    EXPECT_NEAR(Exp(x) / std::exp(x), 1, 1e-15) << x;
  }
  EXPECT_EQ(Exp(0), 1);
}

TEST(Exp, SaturatesAtBothEnds) {
  EXPECT_EQ(Exp(-1e300), 0);
  EXPECT_EQ(Exp(-std::numeric_limits<double>::infinity()), 0);
  EXPECT_TRUE(std::isfinite(Exp(1e300)));
  EXPECT_EQ(Exp(std::numeric_limits<double>::quiet_NaN()), 0);
}

}  // namespace
}  // namespace viewfix
