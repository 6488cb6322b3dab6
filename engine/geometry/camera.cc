// SPDX-License-Identifier: BSD-3-Clause
#include "engine/geometry/camera.h"

#include <Eigen/LU>
#include <cmath>
#include <span>

#include "engine/base/trig.h"

namespace viewfix {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kPi = 3.14159265358979323846;
constexpr int kMaxNewtonSteps = 40;
constexpr int kMonotonicSamples = 16;
// Of the distorted image plane at unit distance: a millionth of a pixel and less.
constexpr double kConverged = 1e-10;

// 1 + c[0] u + c[1] u^2 + ...
double Polynomial(std::span<const double> c, double u) {
  double sum = 0;
  for (int i = static_cast<int>(c.size()) - 1; i >= 0; --i) sum = (sum + c[i]) * u;
  return 1 + sum;
}

// Derivative of Polynomial() by u.
double PolynomialSlope(std::span<const double> c, double u) {
  double sum = 0;
  for (int i = static_cast<int>(c.size()) - 1; i >= 0; --i) sum = sum * u + (i + 1) * c[i];
  return sum;
}

// Whether 1 + sum of the negative terms stays positive: it bounds the polynomial from below on
// all of [0, u], so that most points need no search.
bool NegativeTermsAreSmall(std::span<const double> c, double u) {
  double sum = 0;
  for (int i = static_cast<int>(c.size()) - 1; i >= 0; --i) {
    sum = (sum + (c[i] < 0 ? c[i] : 0)) * u;
  }
  return 1 + sum > 0;
}

template <typename SlopeSign>
bool PositiveUpTo(double u, const SlopeSign& slope_sign) {
  for (int i = 1; i <= kMonotonicSamples; ++i) {
    if (!(slope_sign(u * i / kMonotonicSamples) > 0)) return false;
  }
  return true;
}

// Brown-Conrady on the image plane at unit distance: the radius grows by N(u) / D(u), u = r^2.
class BrownConrady {
 public:
  explicit BrownConrady(const std::array<double, 8>& d)
      : n_{d[0], d[1], d[4]}, d_{d[5], d[6], d[7]}, p1_(d[2]), p2_(d[3]) {
    for (int i = 0; i < 3; ++i) slope_[i] = (2 * i + 3) * n_[i];
    rational_ = d_[0] != 0 || d_[1] != 0 || d_[2] != 0;
  }

  // Whether the radius grows all the way from the centre to r^2 = u. Beyond the first fold
  // the model shows places a second time, where no lens shows them.
  bool IsMonotonicUpTo(double u) const {
    if (!rational_) {
      if (NegativeTermsAreSmall(slope_, u)) return true;
      return PositiveUpTo(u, [this](double v) { return Polynomial(slope_, v); });
    }
    return PositiveUpTo(u, [this](double v) {
      const double n = Polynomial(n_, v);
      const double d = Polynomial(d_, v);
      if (!(d > 0)) return -1.0;
      return n * d + 2 * v * (PolynomialSlope(n_, v) * d - n * PolynomialSlope(d_, v));
    });
  }

  Vector2d Distort(const Vector2d& p, Matrix2d* jacobian) const {
    const double x = p.x(), y = p.y();
    const double u = x * x + y * y;
    const double inverse_d = rational_ ? 1 / Polynomial(d_, u) : 1.0;
    const double radial = Polynomial(n_, u) * inverse_d;
    if (jacobian != nullptr) {
      const double slope =
          (PolynomialSlope(n_, u) - (rational_ ? radial * PolynomialSlope(d_, u) : 0.0)) *
          inverse_d;
      const double cross = 2 * x * y * slope + 2 * p1_ * x + 2 * p2_ * y;
      *jacobian << radial + 2 * x * x * slope + 2 * p1_ * y + 6 * p2_ * x, cross, cross,
          radial + 2 * y * y * slope + 6 * p1_ * y + 2 * p2_ * x;
    }
    return {x * radial + 2 * p1_ * x * y + p2_ * (u + 2 * x * x),
            y * radial + p1_ * (u + 2 * y * y) + 2 * p2_ * x * y};
  }

  // Newton's method, each step shortened until it stays where the model is monotonic.
  bool Undistort(const Vector2d& distorted, Vector2d& p) const {
    p = distorted;
    for (int i = 0; i < kMaxNewtonSteps && !IsInDomain(p); ++i) p *= 0.5;
    for (int i = 0; i < kMaxNewtonSteps; ++i) {
      Matrix2d jacobian;
      const Vector2d error = Distort(p, &jacobian) - distorted;
      if (error.squaredNorm() < kConverged * kConverged) return IsInDomain(p);
      Vector2d step = -(jacobian.inverse() * error);
      for (int half = 0; half < kMaxNewtonSteps && !IsInDomain(p + step); ++half) step *= 0.5;
      p += step;
    }
    return false;
  }

 private:
  bool IsInDomain(const Vector2d& p) const {
    const double u = p.squaredNorm();
    if (!(u < 1e12) || !IsMonotonicUpTo(u)) return false;
    Matrix2d jacobian;
    Distort(p, &jacobian);
    return jacobian.determinant() > 0;
  }

  std::array<double, 3> n_, d_;
  std::array<double, 3> slope_{};  // d (r N) / dr = 1 + slope[0] u + ...
  double p1_, p2_;
  bool rational_ = false;
};

// Kannala-Brandt: the distorted radius is a polynomial of the angle from the axis.
class KannalaBrandt {
 public:
  explicit KannalaBrandt(const std::array<double, 8>& d) : k_{d[0], d[1], d[2], d[3]} {
    for (int i = 0; i < 4; ++i) slope_[i] = (2 * i + 3) * k_[i];
  }

  bool IsMonotonicUpTo(double angle) const {
    const double u = angle * angle;
    if (NegativeTermsAreSmall(slope_, u)) return true;
    return PositiveUpTo(u, [this](double v) { return Polynomial(slope_, v); });
  }
  double Radius(double angle) const { return angle * Polynomial(k_, angle * angle); }
  double Slope(double angle) const { return Polynomial(slope_, angle * angle); }

  // The angle seen at a radius: Newton's method inside a bracket that bisection narrows.
  bool Angle(double radius, double& angle) const {
    double low = 0;
    double high = kPi;
    angle = radius < kPi ? radius : kPi;
    for (int i = 0; i < 2 * kMaxNewtonSteps; ++i) {
      const bool monotonic = IsMonotonicUpTo(angle);
      const double error = Radius(angle) - radius;
      if (monotonic && error < kConverged && error > -kConverged) return true;
      (monotonic && error < 0 ? low : high) = angle;
      const double newton = angle - error / Slope(angle);
      angle = monotonic && newton > low && newton < high ? newton : 0.5 * (low + high);
    }
    return false;
  }

 private:
  std::array<double, 4> k_;
  std::array<double, 4> slope_{};  // d radius / d angle = 1 + slope[0] angle^2 + ...
};

// On the image plane at unit distance, before focal length and centre.
using Jacobian23 = Eigen::Matrix<double, 2, 3>;

bool ProjectThroughPlane(const Camera& camera, const Vector3d& point, Vector2d& plane,
                         Jacobian23* jacobian) {
  if (!(point.z() > 0)) return false;
  const double inverse_z = 1 / point.z();
  const Vector2d p(point.x() * inverse_z, point.y() * inverse_z);
  Matrix2d distortion = Matrix2d::Identity();
  plane = p;
  if (camera.model == CameraModel::kBrownConrady) {
    const BrownConrady model(camera.distortion);
    if (!model.IsMonotonicUpTo(p.squaredNorm())) return false;
    plane = model.Distort(p, &distortion);
    if (!(distortion.determinant() > 0)) return false;
  }
  if (jacobian != nullptr) {
    jacobian->leftCols<2>() = distortion * inverse_z;
    jacobian->col(2) = distortion * (-inverse_z * p);
  }
  return true;
}

bool ProjectFisheye(const Camera& camera, const Vector3d& point, Vector2d& plane,
                    Jacobian23* jacobian) {
  const double x = point.x(), y = point.y(), z = point.z();
  const double r = std::sqrt(x * x + y * y);
  if (r < 1e-9 * z) {  // on the axis the angle is the tangent
    plane = Vector2d(x, y) / z;
    if (jacobian != nullptr) *jacobian << 1 / z, 0, -x / (z * z), 0, 1 / z, -y / (z * z);
    return true;
  }
  if (!(r > 0)) return false;
  const KannalaBrandt model(camera.distortion);
  const double angle = Atan2OfNonNegative(r, z);
  if (!model.IsMonotonicUpTo(angle)) return false;
  const double scale = model.Radius(angle) / r;
  plane = Vector2d(x * scale, y * scale);
  if (jacobian != nullptr) {
    const double slope = model.Slope(angle);
    const double inverse_squared = 1 / (r * r + z * z);
    const double by_r = (slope * z * inverse_squared - scale) / (r * r);  // d scale / dr / r
    const double by_z = -slope * inverse_squared;
    *jacobian << scale + x * x * by_r, x * y * by_r, x * by_z, x * y * by_r, scale + y * y * by_r,
        y * by_z;
  }
  return true;
}

bool UnprojectFisheye(const Camera& camera, const Vector2d& plane, Vector3d& bearing) {
  const double radius = plane.norm();
  double angle = 0;
  if (!KannalaBrandt(camera.distortion).Angle(radius, angle)) return false;
  const auto [sine, cosine] = SinCos(angle);
  const double scale = radius > 1e-12 ? sine / radius : 1.0;
  bearing = Vector3d(plane.x() * scale, plane.y() * scale, cosine).normalized();
  return true;
}

}  // namespace

Status Camera::Validate() const {
  if (model != CameraModel::kPinhole && model != CameraModel::kBrownConrady &&
      model != CameraModel::kKannalaBrandt) {
    return Status(StatusCode::kInvalidArgument, "a camera's model is not one of the known");
  }
  if (width <= 0 || height <= 0) {
    return Status(StatusCode::kInvalidArgument, "a camera's size is not positive");
  }
  double sum = fx + fy + cx + cy;
  for (const double k : distortion) sum += k;
  if (!std::isfinite(sum)) {
    return Status(StatusCode::kInvalidArgument, "a camera's number is not finite");
  }
  if (!(fx > 0) || !(fy > 0)) {
    return Status(StatusCode::kInvalidArgument, "a camera's focal length is not positive");
  }
  return {};
}

Camera Camera::ResizedTo(int new_width, int new_height) const {
  Camera resized = *this;
  const double scale_x = static_cast<double>(new_width) / width;
  const double scale_y = static_cast<double>(new_height) / height;
  resized.width = new_width;
  resized.height = new_height;
  resized.fx = fx * scale_x;
  resized.fy = fy * scale_y;
  resized.cx = (cx + 0.5) * scale_x - 0.5;
  resized.cy = (cy + 0.5) * scale_y - 0.5;
  return resized;
}

bool Camera::Project(const Vector3d& point_in_cam, Vector2d& pixel,
                     Eigen::Matrix<double, 2, 3>* jacobian) const {
  Vector2d plane;
  const bool seen = model == CameraModel::kKannalaBrandt
                        ? ProjectFisheye(*this, point_in_cam, plane, jacobian)
                        : ProjectThroughPlane(*this, point_in_cam, plane, jacobian);
  if (!seen) return false;
  pixel = Vector2d(fx * plane.x() + cx, fy * plane.y() + cy);
  if (jacobian != nullptr) {
    jacobian->row(0) *= fx;
    jacobian->row(1) *= fy;
  }
  return std::isfinite(pixel.x()) && std::isfinite(pixel.y());
}

bool Camera::Unproject(const Vector2d& pixel, Vector3d& bearing_in_cam) const {
  const Vector2d plane((pixel.x() - cx) / fx, (pixel.y() - cy) / fy);
  if (!std::isfinite(plane.x()) || !std::isfinite(plane.y())) return false;
  if (model == CameraModel::kKannalaBrandt) return UnprojectFisheye(*this, plane, bearing_in_cam);
  Vector2d p = plane;
  if (model == CameraModel::kBrownConrady && !BrownConrady(distortion).Undistort(plane, p)) {
    return false;
  }
  bearing_in_cam = Vector3d(p.x(), p.y(), 1).normalized();
  return true;
}

}  // namespace viewfix
