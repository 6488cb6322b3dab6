// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/adjust.h"

#include <ceres/ceres.h>

#include <array>
#include <cmath>

#include "firmware_tools/mapping/map_input.h"
#include "firmware_tools/mapping/rolling_shutter.h"

namespace viewfix {
namespace {

using RowMatrix27 = Eigen::Matrix<double, 2, 7, Eigen::RowMajor>;
using RowMatrix23 = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;
using RowMatrix67 = Eigen::Matrix<double, 6, 7, Eigen::RowMajor>;
Eigen::Map<Eigen::Vector2d> Vector2(double* numbers) {
  return Eigen::Map<Eigen::Vector2d>(numbers);
}
Eigen::Map<Eigen::Vector3d> Vector3(double* numbers) {
  return Eigen::Map<Eigen::Vector3d>(numbers);
}
constexpr double kMaxReadout = 1;         // rows are read within one frame
using PoseBlock = std::array<double, 7>;  // quaternion x y z w, translation

Eigen::Matrix3d Cross(const Eigen::Vector3d& v) {
  return Eigen::Matrix3d{{0, -v.z(), v.y()}, {v.z(), 0, -v.x()}, {-v.y(), v.x(), 0}};
}

Rigid3 ReadPose(const double* block) {
  return {Eigen::Quaterniond(Eigen::Map<const Eigen::Vector4d>(block)),
          Eigen::Map<const Eigen::Vector3d>(block + 4)};
}

PoseBlock WritePose(const Rigid3& pose) {
  PoseBlock block;
  Eigen::Map<Eigen::Vector4d>(block.data()) = pose.rotation.coeffs();
  Eigen::Map<Eigen::Vector3d>(block.data() + 4) = pose.translation;
  return block;
}

// Increments of a pose: a rotation on the left, and a translation. Cost functions give their
// Jacobians in these six numbers directly, in the first columns of the seven.
class PoseManifold : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 7; }
  int TangentSize() const override { return 6; }

  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override {
    const Rigid3 pose = ReadPose(x);
    const Eigen::Vector3d turn = Eigen::Map<const Eigen::Vector3d>(delta);
    const double angle = turn.norm();
    const Eigen::Quaterniond rotation(Eigen::AngleAxisd(
        angle, angle > 0 ? Eigen::Vector3d(turn / angle) : Eigen::Vector3d(1, 0, 0)));
    const PoseBlock block =
        WritePose({(rotation * pose.rotation).normalized(),
                   pose.translation + Eigen::Map<const Eigen::Vector3d>(delta + 3)});
    std::copy(block.begin(), block.end(), x_plus_delta);
    return true;
  }
  bool PlusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, 7, 6, Eigen::RowMajor>>(jacobian).setIdentity();
    return true;
  }
  bool Minus(const double* y, const double* x, double* y_minus_x) const override {
    const Rigid3 to = ReadPose(y), from = ReadPose(x);
    const Eigen::AngleAxisd turn(to.rotation * from.rotation.conjugate());
    Vector3(y_minus_x) = turn.angle() * turn.axis();
    Vector3(y_minus_x + 3) = to.translation - from.translation;
    return true;
  }
  bool MinusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<RowMatrix67>(jacobian).setIdentity();
    return true;
  }
};

// Reprojection error in units of the nominal pixel. Blocks: pose 7, point 3, factor on the
// focal length 1, readout of the rolling shutter 1.
class ReprojectionCost : public ceres::SizedCostFunction<2, 7, 3, 1, 1> {
 public:
  // Refers to camera and image. `rolls`: the image's motion counts.
  ReprojectionCost(const Camera& camera, const MapImage& image, const Eigen::Vector2d& pixel,
                   bool rolls)
      : camera_(camera),
        image_(image),
        pixel_(pixel),
        weight_(1 / PixelsPerNominal(camera)),
        row_(rolls ? RowOffset(camera, pixel.y()) : 0) {}

  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    const Rigid3 cam_from_world = ReadPose(blocks[0]);
    const Eigen::Vector3d turned =
        cam_from_world.rotation * Eigen::Map<const Eigen::Vector3d>(blocks[1]);
    const double factor = blocks[2][0];
    const Eigen::Vector3d at_middle_row = turned + cam_from_world.translation;
    const Eigen::Vector3d moved = row_ * image_.motion.OfPoint(at_middle_row);
    const double time = blocks[3][0] - image_.readout;
    Eigen::Vector2d projected;
    Eigen::Matrix<double, 2, 3> in_cam;
    if (!camera_.Project(at_middle_row + time * moved, projected, &in_cam)) return false;
    const Eigen::Vector2d from_center = projected - Eigen::Vector2d(camera_.cx, camera_.cy);
    Vector2(residuals) = weight_ * (projected + (factor - 1) * from_center - pixel_);
    if (!jacobians) return true;
    in_cam *= weight_ * factor;
    if (jacobians[3]) Vector2(jacobians[3]) = in_cam * moved;
    in_cam *= Eigen::Matrix3d::Identity() + time * row_ * Cross(image_.motion.turn);
    if (jacobians[0]) {
      Eigen::Map<RowMatrix27>(jacobians[0]) << -in_cam * Cross(turned), in_cam,
          Eigen::Vector2d::Zero();
    }
    if (jacobians[1]) {
      Eigen::Map<RowMatrix23> in_world(jacobians[1]);
      in_world = in_cam * cam_from_world.rotation.toRotationMatrix();
    }
    if (jacobians[2]) Vector2(jacobians[2]) = weight_ * from_center;
    return true;
  }

 private:
  const Camera& camera_;
  const MapImage& image_;
  Eigen::Vector2d pixel_;
  double weight_;
  double row_;
};

// Holds a pose to the one that came in, in units of sigma.
class PosePrior : public ceres::SizedCostFunction<6, 7> {
 public:
  PosePrior(const Rigid3& given, const AdjustOptions& options)
      : given_(given),
        given_center_(Inverse(given).translation),
        rotation_weight_(180 / 3.14159265358979323846 / options.rotation_sigma_deg),
        position_weight_(1 / options.position_sigma) {}

  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    const Rigid3 pose = ReadPose(blocks[0]);
    const Eigen::Quaterniond turn = pose.rotation * given_.rotation.conjugate();
    const Eigen::Matrix3d world_from_cam = pose.rotation.conjugate().toRotationMatrix();
    const double sign = turn.w() < 0 ? -2 : 2;
    Vector3(residuals) = rotation_weight_ * sign * turn.vec();
    Vector3(residuals + 3) =
        position_weight_ * (-world_from_cam * pose.translation - given_center_);
    if (!jacobians || !jacobians[0]) return true;
    Eigen::Map<RowMatrix67> jacobian(jacobians[0]);
    jacobian.setZero();
    jacobian.block<3, 3>(0, 0) = rotation_weight_ * 0.5 * sign *
                                 (turn.w() * Eigen::Matrix3d::Identity() - Cross(turn.vec()));
    jacobian.block<3, 3>(3, 0) = -position_weight_ * world_from_cam * Cross(pose.translation);
    jacobian.block<3, 3>(3, 3) = -position_weight_ * world_from_cam;
    return true;
  }

 private:
  Rigid3 given_;
  Eigen::Vector3d given_center_;
  double rotation_weight_;
  double position_weight_;
};

// A reconstruction as a problem for Ceres.
class Bundle {
 public:
  Bundle(Reconstruction& map, const AdjustOptions& options)
      : map_(map), options_(options), problem_(ProblemOptions()), loss_(options.loss_px) {
    for (const MapImage& image : map.images) poses_.push_back(WritePose(image.cam_from_world));
    factors_.assign(map.cameras.size(), 1.0);
    readouts_.assign(map.cameras.size(), 0.0);
    for (const MapImage& image : map.images) {
      double& readout = readouts_[image.camera_idx];
      if (std::abs(image.readout) > std::abs(readout)) readout = image.readout;
    }
    for (MapPoint& point : map.points) AddPoint(point);
    HoldPoses();
    for (std::size_t c = 0; c < factors_.size(); ++c) HoldCamera(c);
  }

  AdjustReport Solve() {
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::SPARSE_SCHUR;
    options.max_num_iterations = options_.max_iterations;
    options.num_threads = 1;
    options.function_tolerance = options_.function_tolerance;
    // The scale is free: with no damping at all the equations would be singular.
    options.max_trust_region_radius = 1e5;
    options.logging_type = ceres::SILENT;
    options.linear_solver_ordering.reset(Ordering());
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem_, &summary);
    if (summary.IsSolutionUsable()) WriteBack();
    return {static_cast<int>(summary.iterations.size()),
            summary.termination_type == ceres::CONVERGENCE, summary.initial_cost,
            summary.final_cost};
  }

 private:
  static ceres::Problem::Options ProblemOptions() {
    ceres::Problem::Options options;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    return options;
  }

  void AddPoint(MapPoint& point) {
    for (const Observation& seen : point.track) {
      const MapImage& image = map_.images[seen.image_idx];
      problem_.AddResidualBlock(
          new ReprojectionCost(map_.cameras[image.camera_idx], image,
                               image.keypoints[seen.feature_idx], options_.readout),
          &loss_, poses_[seen.image_idx].data(), point.position.data(), &factors_[image.camera_idx],
          &readouts_[image.camera_idx]);
    }
  }

  void HoldPoses() {
    bool frame_is_held = options_.position_sigma > 0;
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      if (!problem_.HasParameterBlock(poses_[i].data())) continue;
      problem_.SetManifold(poses_[i].data(), &manifold_);
      if (!options_.poses || !frame_is_held) {
        problem_.SetParameterBlockConstant(poses_[i].data());
        frame_is_held = true;
      } else if (options_.position_sigma > 0) {
        problem_.AddResidualBlock(new PosePrior(map_.images[i].cam_from_world, options_), nullptr,
                                  poses_[i].data());
      }
    }
  }

  void HoldCamera(std::size_t camera_idx) {
    double* factor = &factors_[camera_idx];
    double* readout = &readouts_[camera_idx];
    if (!problem_.HasParameterBlock(factor)) return;
    if (!options_.focal) problem_.SetParameterBlockConstant(factor);
    if (!options_.readout) return problem_.SetParameterBlockConstant(readout);
    problem_.SetParameterLowerBound(readout, 0, -kMaxReadout);
    problem_.SetParameterUpperBound(readout, 0, kMaxReadout);
  }

  ceres::ParameterBlockOrdering* Ordering() {
    auto* ordering = new ceres::ParameterBlockOrdering;
    for (MapPoint& point : map_.points) {
      if (!point.track.empty()) ordering->AddElementToGroup(point.position.data(), 0);
    }
    for (PoseBlock& pose : poses_) {
      if (problem_.HasParameterBlock(pose.data())) ordering->AddElementToGroup(pose.data(), 1);
    }
    for (std::vector<double>* of_cameras : {&factors_, &readouts_}) {
      for (double& value : *of_cameras) {
        if (problem_.HasParameterBlock(&value)) ordering->AddElementToGroup(&value, 1);
      }
    }
    return ordering;
  }

  void WriteBack() {
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      map_.images[i].cam_from_world = ReadPose(poses_[i].data());
    }
    for (std::size_t i = 0; i < factors_.size(); ++i) {
      map_.cameras[i].fx *= factors_[i];
      map_.cameras[i].fy *= factors_[i];
    }
    if (options_.readout) Unroll(readouts_, map_);
  }

  Reconstruction& map_;
  const AdjustOptions& options_;
  PoseManifold manifold_;
  ceres::Problem problem_;
  ceres::CauchyLoss loss_;
  std::vector<PoseBlock> poses_;  // [images]
  std::vector<double> factors_;   // [cameras] on the focal length
  std::vector<double> readouts_;  // [cameras]
};

}  // namespace

AdjustReport Adjust(Reconstruction& map, const AdjustOptions& options) {
  const AdjustReport report = Bundle(map, options).Solve();
  UpdateErrors(map);
  return report;
}

void UpdateErrors(Reconstruction& map) {
  for (MapPoint& point : map.points) {
    double sum = 0;
    for (const Observation& seen : point.track) {
      const MapImage& image = map.images[seen.image_idx];
      Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
      if (map.cameras[image.camera_idx].Project(image.cam_from_world * point.position, pixel)) {
        sum += (pixel - image.keypoints[seen.feature_idx]).norm();
      }
    }
    point.error_px = point.track.empty() ? 0 : sum / static_cast<double>(point.track.size());
  }
}

}  // namespace viewfix
