// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pose/reprojection.h"

namespace viewfix {

double ReprojectionCost(const Camera& camera, const CameraState& state,
                        std::span<const PoseMatch> matches, std::span<const std::uint8_t> used,
                        double huber_sigma) {
  const Eigen::Matrix3d cam_from_world = state.world_from_cam.conjugate().toRotationMatrix();
  const double unseen = HuberLoss(kUnseenSigma * kUnseenSigma, huber_sigma).value;
  double cost = 0;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (!used.empty() && used[i] == 0) continue;
    Eigen::Vector2d residual;
    const bool seen = Reproject<6>(camera, state, cam_from_world, matches[i], residual, nullptr);
    cost += seen ? HuberLoss(residual.squaredNorm(), huber_sigma).value : unseen;
  }
  return cost;
}

template <int P>
NormalEquations<P> BuildNormalEquations(const Camera& camera, const CameraState& state,
                                        std::span<const PoseMatch> matches,
                                        std::span<const std::uint8_t> used, double huber_sigma) {
  const Eigen::Matrix3d cam_from_world = state.world_from_cam.conjugate().toRotationMatrix();
  const double unseen = HuberLoss(kUnseenSigma * kUnseenSigma, huber_sigma).value;
  NormalEquations<P> sum;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (!used.empty() && used[i] == 0) continue;
    Eigen::Vector2d residual;
    Eigen::Matrix<double, 2, P> jacobian;
    if (!Reproject<P>(camera, state, cam_from_world, matches[i], residual, &jacobian)) {
      sum.cost += unseen;
      continue;
    }
    const Loss loss = HuberLoss(residual.squaredNorm(), huber_sigma);
    sum.cost += loss.value;
    ++sum.num_seen;
    for (int row = 0; row < P; ++row) {
      const double x = loss.slope * jacobian(0, row);
      const double y = loss.slope * jacobian(1, row);
      sum.gradient[row] += x * residual.x() + y * residual.y();
      for (int col = row; col < P; ++col) {
        sum.information(row, col) += x * jacobian(0, col) + y * jacobian(1, col);
      }
    }
  }
  for (int row = 0; row < P; ++row) {
    for (int col = 0; col < row; ++col) sum.information(row, col) = sum.information(col, row);
  }
  return sum;
}

template NormalEquations<6> BuildNormalEquations<6>(const Camera&, const CameraState&,
                                                    std::span<const PoseMatch>,
                                                    std::span<const std::uint8_t>, double);
template NormalEquations<7> BuildNormalEquations<7>(const Camera&, const CameraState&,
                                                    std::span<const PoseMatch>,
                                                    std::span<const std::uint8_t>, double);

}  // namespace viewfix
