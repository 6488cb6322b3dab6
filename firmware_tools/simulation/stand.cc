// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/simulation/stand.h"

#include <cmath>
#include <numbers>

namespace viewfix::simulation {
namespace {

constexpr double kPi = std::numbers::pi;

// Not in a wall or a piece of furniture, and with something to see ahead.
bool StandsFree(const Room& room, const Stand& stand) {
  const Eigen::Vector3f at = stand.position.cast<float>();
  if (at.x() < 0.3f || at.y() < 0.3f || at.x() > room.width - 0.3f || at.y() > room.depth - 0.3f) {
    return false;
  }
  for (int i = 0; i < 8; ++i) {
    if (room.scene.Distance(at, Heading(i * kPi / 4), 1.0f) < 0.3f) return false;
  }
  if (room.scene.Distance(at, -Eigen::Vector3f::UnitZ(), 3.0f) < 0.4f) return false;
  for (const double aside : {-0.35, 0.0, 0.35}) {
    if (room.scene.Distance(at, Heading(stand.heading + aside), 2.0f) < 1.0f) return false;
  }
  return true;
}

// In the hand: somewhat off the line, tilted, and now and then in portrait.
Stand HandHeld(const Approach& approach, double distance, Random& random) {
  Stand stand;
  const Eigen::Vector3f along = Heading(double{approach.heading});
  const Eigen::Vector3f across(-along.y(), along.x(), 0);
  const Eigen::Vector3f at = approach.target - static_cast<float>(distance) * along +
                             static_cast<float>(random.Uniform(-0.7, 0.7)) * across;
  stand.position = {double{at.x()}, double{at.y()}, random.Uniform(1.2, 1.85)};
  stand.heading = double{approach.heading} + random.Uniform(-0.2, 0.2);
  stand.pitch = random.Uniform(-0.15, 0.2);
  stand.roll = (random.Uniform(-0.26, 0.26) + random.Uniform(-0.26, 0.26));
  if (random.Chance(0.06)) stand.roll += random.Chance(0.5) ? kPi / 2 : -kPi / 2;
  return stand;
}

}  // namespace

Pose PoseOf(const Stand& stand) {
  const double c = std::cos(stand.pitch);
  const Eigen::Vector3d forward(c * std::cos(stand.heading), c * std::sin(stand.heading),
                                -std::sin(stand.pitch));
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d world_from_level;
  world_from_level << right, forward.cross(right), forward;
  const Eigen::AngleAxisd level_from_cam(stand.roll, Eigen::Vector3d::UnitZ());
  return {Eigen::Quaterniond(world_from_level * level_from_cam), stand.position};
}

Eigen::Vector3f Heading(double angle) {
  return {static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle)), 0.0f};
}

Stand FreeStand(const Room& room, const Approach& approach, double distance, Random& random) {
  for (int attempt = 0; attempt < 60; ++attempt) {
    const Stand stand = HandHeld(approach, distance, random);
    if (StandsFree(room, stand)) return stand;
    if (attempt % 10 == 9) {
      const double middle = 0.5 * double{approach.nearest + approach.farthest};
      distance += 0.25 * (middle - distance);
    }
  }
  throw ToolError(room.name + "/" + approach.view + ": no free place for a camera");
}

}  // namespace viewfix::simulation
