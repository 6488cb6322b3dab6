// SPDX-License-Identifier: BSD-3-Clause
#include "engine/geometry/rigid3.h"

#include <gtest/gtest.h>

namespace viewfix {
namespace {

TEST(Rigid3, InverseAndProduct) {
  const Rigid3 b_from_a{Eigen::Quaterniond(0.3, -0.5, 0.7, 0.4).normalized(), {1, -2, 3}};
  const Rigid3 c_from_b{Eigen::Quaterniond(-0.1, 0.2, 0.9, 0.3).normalized(), {4, 0, -1}};
  const Eigen::Vector3d point_in_a(0.3, 5, -2);
  const Eigen::Vector3d there_and_back = Inverse(b_from_a) * (b_from_a * point_in_a);
  EXPECT_TRUE(there_and_back.isApprox(point_in_a, 1e-14));
  const Rigid3 c_from_a = c_from_b * b_from_a;
  EXPECT_TRUE((c_from_a * point_in_a).isApprox(c_from_b * (b_from_a * point_in_a), 1e-14));
}

}  // namespace
}  // namespace viewfix
