// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/rolling_shutter.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace viewfix {
namespace {

// Neighbours further apart than this, in frames, or turned further, do not tell how a frame moved.
constexpr double kMaxSteps = 6;
constexpr double kMaxTurn = 0.5;  // radians a frame

Eigen::Vector3d TurnOf(const Rigid3& motion) {
  const Eigen::AngleAxisd turn(motion.rotation);
  return turn.angle() * turn.axis();
}

// Of a frame, as far as points move from the frame before to the one after.
ShutterMotion MotionBetween(const Rigid3& before_from_this, const Rigid3& after_from_this,
                            double steps) {
  return {(TurnOf(after_from_this) - TurnOf(before_from_this)) / steps,
          (after_from_this.translation - before_from_this.translation) / steps};
}

bool IsTold(const ShutterMotion& motion, double steps) {
  return steps > 0 && steps <= kMaxSteps && motion.turn.norm() <= kMaxTurn;
}

double MedianDepth(const Reconstruction& map, const MapImage& image) {
  std::vector<double> depths;
  for (const int point : image.point_idx) {
    if (point >= 0) depths.push_back((image.cam_from_world * map.points[point].position).z());
  }
  if (depths.empty()) return 0;
  const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle;
}

// Where the key point would be had its row been exposed `time` earlier.
Eigen::Vector2d MovedBack(const Camera& camera, const ShutterMotion& motion, double time,
                          double depth, const Eigen::Vector2d& pixel) {
  Eigen::Vector3d ray;
  if (!camera.Unproject(pixel, ray) || ray.z() <= 0) return pixel;
  const Eigen::Vector3d point = depth / ray.z() * ray;
  Eigen::Vector2d seen, moved;
  if (!camera.Project(point, seen) ||
      !camera.Project(point - time * motion.OfPoint(point), moved)) {
    return pixel;
  }
  return pixel + moved - seen;
}

}  // namespace

void SetMotions(const MapInput& input, Reconstruction& map) {
  std::vector<const MapFrame*> frames;
  for (const MapFrame& frame : input.frames) {
    if (frame.cam_from_world) frames.push_back(&frame);
  }
  const int n = static_cast<int>(frames.size());
  const auto is_beside = [&](int i, int other) {
    return other >= 0 && other < n && frames[other]->capture == frames[i]->capture;
  };
  for (int i = 0; i < n; ++i) {
    const int before = is_beside(i, i - 1) ? i - 1 : i;
    const int after = is_beside(i, i + 1) ? i + 1 : i;
    const double steps = frames[after]->time - frames[before]->time;
    const Rigid3 world_from_this = Inverse(*frames[i]->cam_from_world);
    const ShutterMotion motion =
        MotionBetween(*frames[before]->cam_from_world * world_from_this,
                      *frames[after]->cam_from_world * world_from_this, steps);
    map.images[i].motion = IsTold(motion, steps) ? motion : ShutterMotion();
  }
}

void Unroll(std::span<const double> readouts, Reconstruction& map) {
  for (MapImage& image : map.images) {
    const Camera& camera = map.cameras[image.camera_idx];
    const double readout = readouts[image.camera_idx] - image.readout;
    image.readout = readouts[image.camera_idx];
    const double median_depth = MedianDepth(map, image);
    for (std::size_t k = 0; k < image.keypoints.size(); ++k) {
      Eigen::Vector2d& pixel = image.keypoints[k];
      const int point = image.point_idx[k];
      const double depth =
          point < 0 ? median_depth : (image.cam_from_world * map.points[point].position).z();
      if (depth <= 0) continue;
      pixel = MovedBack(camera, image.motion, readout * RowOffset(camera, pixel.y()), depth, pixel);
    }
  }
}

}  // namespace viewfix
