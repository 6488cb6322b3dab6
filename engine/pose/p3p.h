// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

#include "engine/geometry/rigid3.h"

namespace viewfix {

inline constexpr int kMaxP3pSolutions = 4;

// Poses of a calibrated camera that sees three known points: the lengths along the bearings are
// the intersections of two ellipses found through one eigenvector pair, [1]. Only sqrt; no heap.
//   bearings_in_cam   unit vectors
//   points_in_world   same order, any unit of length
//   cam_from_world    the solutions; every one has the points in front, along their bearings
// Returns how many there are, 0..4. Collinear or coincident points, coincident bearings and
// numbers that are not finite give 0 or solutions that are finite.
// [1] M. Persson, K. Nordberg, Lambda Twist: An Accurate Fast Robust Perspective Three Point
//     (P3P) Solver, ECCV 2018.
int SolveP3p(const std::array<Eigen::Vector3d, 3>& bearings_in_cam,
             const std::array<Eigen::Vector3d, 3>& points_in_world,
             std::array<Rigid3, kMaxP3pSolutions>& cam_from_world);

}  // namespace viewfix
