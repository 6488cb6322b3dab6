// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pose/motion_model.h"

#include <gtest/gtest.h>

namespace viewfix {
namespace {

// A camera that goes on by `step` and turns by `angle` about the vertical with every frame.
Rigid3 WorldFromCam(int frame, const Eigen::Vector3d& step, double angle) {
  const Eigen::AngleAxisd turn(0.3 + angle * frame, Eigen::Vector3d(0.1, 1, -0.2).normalized());
  return {Eigen::Quaterniond(turn), Eigen::Vector3d(1, -2, 3) + frame * step};
}

void ExpectNear(const Rigid3& a, const Rigid3& b, double metres, double radians) {
  EXPECT_LE((a.translation - b.translation).norm(), metres);
  EXPECT_LE(a.rotation.angularDistance(b.rotation), radians);
}

const Eigen::Vector3d kStep(0.1, 0, 0.05);
constexpr double kTurn = 0.05;

TEST(MotionModel, KnowsNothingAtFirst) { EXPECT_FALSE(MotionModel().Predict(7)); }

TEST(MotionModel, OnePoseStaysWhereItIs) {
  MotionModel motion;
  motion.Update(5, 2, WorldFromCam(0, kStep, kTurn));
  const auto prediction = motion.Predict(9);
  ASSERT_TRUE(prediction);
  EXPECT_EQ(prediction->map_idx, 2);
  ExpectNear(Inverse(prediction->cam_from_world), WorldFromCam(0, kStep, kTurn), 1e-12, 1e-7);
}

TEST(MotionModel, GoesOnAtConstantVelocityAndTurn) {
  MotionModel motion;
  for (int frame = 0; frame < 8; ++frame) {
    motion.Update(frame, 0, WorldFromCam(frame, kStep, kTurn));
    if (frame == 0) continue;
    const auto prediction = motion.Predict(frame + 1);
    ASSERT_TRUE(prediction);
    ExpectNear(Inverse(prediction->cam_from_world), WorldFromCam(frame + 1, kStep, kTurn), 1e-12,
               1e-7);
  }
}

// Turns scale as half angles' tangents do, which is no more than nearly linear.
TEST(MotionModel, GapsAreBridgedInProportion) {
  MotionModel motion;
  motion.Update(0, 0, WorldFromCam(0, kStep, kTurn));
  motion.Update(2, 0, WorldFromCam(2, kStep, kTurn));
  for (const int frame : {3, 4, 6}) {
    const auto prediction = motion.Predict(frame);
    ASSERT_TRUE(prediction);
    ExpectNear(Inverse(prediction->cam_from_world), WorldFromCam(frame, kStep, kTurn), 1e-12, 1e-3);
  }
}

// A quaternion and its negative are one rotation.
TEST(MotionModel, TheSignOfAQuaternionSaysNothing) {
  MotionModel motion;
  motion.Update(0, 0, WorldFromCam(0, kStep, kTurn));
  Rigid3 negated = WorldFromCam(1, kStep, kTurn);
  negated.rotation.coeffs() *= -1;
  motion.Update(1, 0, negated);
  ExpectNear(Inverse(motion.Predict(2)->cam_from_world), WorldFromCam(2, kStep, kTurn), 1e-12,
             1e-7);
}

TEST(MotionModel, ForgetsAfterTooManyFrames) {
  MotionModel motion;
  motion.Update(3, 0, WorldFromCam(0, kStep, kTurn));
  EXPECT_TRUE(motion.Predict(3 + MotionModel::kMaxGap));
  EXPECT_FALSE(motion.Predict(4 + MotionModel::kMaxGap));
}

TEST(MotionModel, PredictsNeitherThePastNorThePresent) {
  MotionModel motion;
  motion.Update(3, 0, WorldFromCam(0, kStep, kTurn));
  EXPECT_FALSE(motion.Predict(3));
  EXPECT_FALSE(motion.Predict(2));
}

// Velocity between two maps, or over frames out of order or far apart, means nothing.
TEST(MotionModel, BeginsAnew) {
  const Rigid3 first = WorldFromCam(0, kStep, kTurn);
  const Rigid3 second = WorldFromCam(1, kStep, kTurn);
  struct Case {
    std::uint64_t sequence;
    int map_idx;
  };
  for (const Case& c : {Case{6, 1}, Case{5, 0}, Case{4, 0}, Case{6 + MotionModel::kMaxGap, 0}}) {
    MotionModel motion;
    motion.Update(5, 0, first);
    motion.Update(c.sequence, c.map_idx, second);
    const auto prediction = motion.Predict(c.sequence + 1);
    ASSERT_TRUE(prediction);
    EXPECT_EQ(prediction->map_idx, c.map_idx);
    ExpectNear(Inverse(prediction->cam_from_world), second, 1e-12, 1e-7);
  }
}

TEST(MotionModel, ALostFrameEndsTheMotion) {
  MotionModel motion;
  motion.Update(0, 0, WorldFromCam(0, kStep, kTurn));
  motion.Update(1, 0, WorldFromCam(1, kStep, kTurn));
  motion.Lose();
  EXPECT_FALSE(motion.Predict(2));
}

TEST(MotionModel, TheLastSequenceNumbersDoNotOverflow) {
  constexpr std::uint64_t kLast = ~std::uint64_t{0};
  MotionModel motion;
  motion.Update(kLast - 1, 0, WorldFromCam(0, kStep, kTurn));
  EXPECT_TRUE(motion.Predict(kLast));
  motion.Update(kLast, 0, WorldFromCam(1, kStep, kTurn));
  EXPECT_FALSE(motion.Predict(0));
}

}  // namespace
}  // namespace viewfix
