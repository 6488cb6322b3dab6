// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pose/motion_model.h"

namespace viewfix {
namespace {

// `turn` for `share` of its way; exact for small turns, which is what happens between frames.
Eigen::Quaterniond Scaled(const Eigen::Quaterniond& turn, double share) {
  const double sign = turn.w() < 0 ? -1 : 1;
  const Eigen::Vector3d half = share * sign * turn.vec();
  return Eigen::Quaterniond(sign * turn.w(), half.x(), half.y(), half.z()).normalized();
}

}  // namespace

void MotionModel::Update(std::uint64_t sequence, int map_idx, const Rigid3& world_from_cam) {
  const bool goes_on = last_ && last_->map_idx == map_idx && sequence > last_->sequence &&
                       sequence - last_->sequence <= kMaxGap;
  before_ = goes_on ? last_ : std::nullopt;
  last_ = Known{sequence, map_idx, world_from_cam};
}

std::optional<MotionModel::Prediction> MotionModel::Predict(std::uint64_t sequence) const {
  if (!last_ || sequence <= last_->sequence || sequence - last_->sequence > kMaxGap) {
    return std::nullopt;
  }
  Rigid3 world_from_cam = last_->world_from_cam;
  if (before_) {
    const double share = static_cast<double>(sequence - last_->sequence) /
                         static_cast<double>(last_->sequence - before_->sequence);
    const Rigid3& from = before_->world_from_cam;
    world_from_cam.translation += share * (world_from_cam.translation - from.translation);
    const Eigen::Quaterniond turn = world_from_cam.rotation * from.rotation.conjugate();
    world_from_cam.rotation = (Scaled(turn, share) * world_from_cam.rotation).normalized();
  }
  return Prediction{last_->map_idx, Inverse(world_from_cam)};
}

}  // namespace viewfix
