// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pose/p3p.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace viewfix {
namespace {

using Eigen::Vector3d;

struct Problem {
  std::array<Vector3d, 3> bearings, points;
  Rigid3 cam_from_world;
};

Vector3d RandomVector(std::mt19937& random) {
  std::normal_distribution<double> normal(0, 1);
  return {normal(random), normal(random), normal(random)};
}

// Three points of a 90 degree view, 0.5 to 10 away.
Problem RandomProblem(std::mt19937& random) {
  std::uniform_real_distribution<double> unit(-1, 1);
  Problem problem;
  problem.cam_from_world.rotation =
      Eigen::Quaterniond(unit(random), unit(random), unit(random), unit(random)).normalized();
  problem.cam_from_world.translation = 5 * RandomVector(random);
  for (int i = 0; i < 3; ++i) {
    problem.bearings[i] = Vector3d(unit(random), unit(random), 1).normalized();
    const double length = 5.25 + 4.75 * unit(random);
    problem.points[i] = Inverse(problem.cam_from_world) * (length * problem.bearings[i]);
  }
  return problem;
}

double ErrorOf(const Rigid3& a, const Rigid3& b) {
  return a.rotation.angularDistance(b.rotation) + (a.translation - b.translation).norm();
}

TEST(P3p, FindsTheTruth) {
  std::mt19937 random(1);
  std::array<Rigid3, kMaxP3pSolutions> poses;
  int found = 0;
  constexpr int kProblems = 50000;
  for (int i = 0; i < kProblems; ++i) {
    const Problem problem = RandomProblem(random);
    const int count = SolveP3p(problem.bearings, problem.points, poses);
    double best = 1;
    for (int k = 0; k < count; ++k)
      best = std::min(best, ErrorOf(poses[k], problem.cam_from_world));
    found += best < 1e-6;
  }
  RecordProperty("share_found", std::to_string(double(found) / kProblems));
  EXPECT_GE(found, 0.9995 * kProblems);
}

TEST(P3p, EverySolutionSeesThePointsAlongTheBearings) {
  std::mt19937 random(2);
  std::array<Rigid3, kMaxP3pSolutions> poses;
  int wrong = 0, total = 0;
  for (int i = 0; i < 10000; ++i) {
    const Problem problem = RandomProblem(random);
    const int count = SolveP3p(problem.bearings, problem.points, poses);
    for (int k = 0; k < count; ++k) {
      EXPECT_NEAR(poses[k].rotation.norm(), 1, 1e-12);
      double error = 0;
      for (int j = 0; j < 3; ++j) {
        const Vector3d seen = (poses[k] * problem.points[j]).normalized();
        error = std::max(error, (seen - problem.bearings[j]).norm());
      }
      wrong += error > 1e-6;
      ++total;
    }
  }
  EXPECT_GT(total, 10000);
  EXPECT_LE(wrong, total / 1000);
}

void ExpectFinite(const Problem& problem) {
  std::array<Rigid3, kMaxP3pSolutions> poses;
  const int count = SolveP3p(problem.bearings, problem.points, poses);
  ASSERT_GE(count, 0);
  ASSERT_LE(count, kMaxP3pSolutions);
  for (int k = 0; k < count; ++k) {
    EXPECT_TRUE(poses[k].rotation.coeffs().allFinite());
    EXPECT_TRUE(poses[k].translation.allFinite());
  }
}

TEST(P3p, CollinearOrCoincidentPointsGiveNoSolution) {
  std::mt19937 random(3);
  std::array<Rigid3, kMaxP3pSolutions> poses;
  for (int i = 0; i < 1000; ++i) {
    Problem problem = RandomProblem(random);
    problem.points[2] = problem.points[0] + 0.7 * (problem.points[1] - problem.points[0]);
    EXPECT_EQ(SolveP3p(problem.bearings, problem.points, poses), 0);
    problem.points[2] = problem.points[1];
    EXPECT_EQ(SolveP3p(problem.bearings, problem.points, poses), 0);
    problem.points[1] = problem.points[0];
    EXPECT_EQ(SolveP3p(problem.bearings, problem.points, poses), 0);
  }
}

TEST(P3p, OddProblemsGiveFiniteSolutionsOrNone) {
  std::mt19937 random(4);
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  for (int i = 0; i < 1000; ++i) {
    Problem problem = RandomProblem(random);
    problem.bearings[1] = problem.bearings[0];
    ExpectFinite(problem);
    problem.bearings[2] = problem.bearings[0];
    ExpectFinite(problem);
    problem = RandomProblem(random);
    for (auto& bearing : problem.bearings) bearing = -bearing;
    ExpectFinite(problem);
    for (auto& bearing : problem.bearings) bearing = RandomVector(random).normalized();
    ExpectFinite(problem);
    for (auto& point : problem.points) point *= 1e-9;
    ExpectFinite(problem);
    problem.points[i % 3].y() = kNan;
    ExpectFinite(problem);
    problem = RandomProblem(random);
    problem.bearings[i % 3].x() = kNan;
    ExpectFinite(problem);
  }
}

// An equilateral triangle seen along its axis: all coefficients tie.
TEST(P3p, ASymmetricTriangleIsSolved) {
  Problem problem;
  for (int i = 0; i < 3; ++i) {
    const double angle = 2.0943951023931953 * i;
    problem.points[i] = Vector3d(std::cos(angle), std::sin(angle), 2);
    problem.bearings[i] = problem.points[i].normalized();
  }
  std::array<Rigid3, kMaxP3pSolutions> poses;
  const int count = SolveP3p(problem.bearings, problem.points, poses);
  double best = 1;
  for (int k = 0; k < count; ++k) best = std::min(best, ErrorOf(poses[k], Rigid3{}));
  EXPECT_LT(best, 1e-6);
}

}  // namespace
}  // namespace viewfix
