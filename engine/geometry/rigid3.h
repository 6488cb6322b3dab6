// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>

namespace viewfix {

// A rotation followed by a translation: x_in_b = b_from_a * x_in_a. Names carry the frames,
// so that c_from_a = c_from_b * b_from_a checks itself by reading. No heap.
struct Rigid3 {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  // unit
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& point_in_a) const {
    return rotation * point_in_a + translation;
  }
};

// c_from_a = c_from_b * b_from_a
inline Rigid3 operator*(const Rigid3& c_from_b, const Rigid3& b_from_a) {
  return {(c_from_b.rotation * b_from_a.rotation).normalized(),
          c_from_b.rotation * b_from_a.translation + c_from_b.translation};
}

// a_from_b, given b_from_a.
inline Rigid3 Inverse(const Rigid3& b_from_a) {
  const Eigen::Quaterniond a_from_b = b_from_a.rotation.conjugate();
  return {a_from_b, -(a_from_b * b_from_a.translation)};
}

}  // namespace viewfix
