// SPDX-License-Identifier: BSD-3-Clause
#include "engine/base/trig.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace viewfix {
namespace {

TEST(Trig, AtanAgreesWithLibm) {
  for (double x = 0; x < 20; x += 0.00137) EXPECT_NEAR(AtanOfNonNegative(x), std::atan(x), 5e-16);
  for (double x = 1e-12; x < 1e300; x *= 7) EXPECT_NEAR(AtanOfNonNegative(x), std::atan(x), 5e-16);
  EXPECT_EQ(AtanOfNonNegative(0), 0);
  EXPECT_NEAR(AtanOfNonNegative(std::numeric_limits<double>::infinity()), std::acos(0.0), 5e-16);
}

TEST(Trig, Atan2CoversTheUpperHalfPlane) {
  for (double angle = 0; angle <= 3.1415; angle += 0.00211) {
    const double y = 3 * std::abs(std::sin(angle));
    const double x = 3 * std::cos(angle);
    EXPECT_NEAR(Atan2OfNonNegative(y, x), std::atan2(y, x), 1e-15) << angle;
  }
  EXPECT_EQ(Atan2OfNonNegative(0, 0), 0);
  EXPECT_NEAR(Atan2OfNonNegative(0, -1), std::acos(-1.0), 1e-15);
}

TEST(Trig, SinCosAgreesWithLibm) {
  for (double angle = -4; angle <= 4; angle += 0.00173) {
    EXPECT_NEAR(SinCos(angle).sin, std::sin(angle), 5e-16) << angle;
    EXPECT_NEAR(SinCos(angle).cos, std::cos(angle), 5e-16) << angle;
  }
}

}  // namespace
}  // namespace viewfix
