// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pose/p3p.h"

#include <Eigen/LU>
#include <cmath>
#include <utility>

namespace viewfix {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Bearings = std::array<Vector3d, 3>;
using Points = std::array<Vector3d, 3>;

// Of the sine squared of the angle between two sides of the triangle: collinear below.
constexpr double kMinSineSquared = 1e-12;

// Law of cosines for every two of the three rays, [1] eq. (5):
// li^2 + lj^2 + b_ij li lj = a_ij.
struct Triangle {
  double a12, a13, a23;
  double b12, b13, b23;
};

// Real roots of x^2 + b x + c, the larger in size computed without cancellation.
bool SolveQuadratic(double b, double c, double& root1, double& root2) {
  const double discriminant = b * b - 4 * c;
  if (!(discriminant >= 0)) return false;
  const double q = -0.5 * (b + (b < 0 ? -std::sqrt(discriminant) : std::sqrt(discriminant)));
  root1 = q;
  root2 = q != 0 ? c / q : 0.0;
  return true;
}

// One real root of x^3 + b x^2 + c x + d: Newton's method from beyond the stationary points,
// from where it cannot leave the root's side.
double CubicRoot(double b, double c, double d) {
  double x = -b / 3;
  const double discriminant = b * b - 3 * c;
  if (discriminant >= 0) {
    const double spread = std::sqrt(discriminant);
    const double left = (-b - spread) / 3;
    const double at_left = ((left + b) * left + c) * left + d;
    if (at_left > 0) {
      x = left - std::sqrt(-at_left / (3 * left + b));
    } else {
      const double right = (-b + spread) / 3;
      const double at_right = ((right + b) * right + c) * right + d;
      x = right + std::sqrt(-at_right / (3 * right + b));
    }
  } else if (std::abs((3 * x + 2 * b) * x + c) < 1e-4) {
    x += 1;
  }
  for (int i = 0; i < 50; ++i) {
    const double value = ((x + b) * x + c) * x + d;
    const double slope = (3 * x + 2 * b) * x + c;
    if (slope == 0) break;
    const double step = value / slope;
    x -= step;
    if (!(std::abs(step) > 1e-15 * std::abs(x))) break;
  }
  return x;
}

// The degenerate conic D = D1 + g D2 of the pencil, [1] eq. (9), and its g.
Matrix3d DegenerateConic(const Triangle& t) {
  const double c31 = -0.5 * t.b13, c23 = -0.5 * t.b23, c12 = -0.5 * t.b12;
  const double blob = c12 * c23 * c31 - 1;
  const double s31 = 1 - c31 * c31, s23 = 1 - c23 * c23, s12 = 1 - c12 * c12;  // squared sines
  const double p3 = t.a13 * (t.a23 * s31 - t.a13 * s23);
  const double p2 =
      2 * blob * t.a23 * t.a13 + t.a13 * (2 * t.a12 + t.a13) * s23 + t.a23 * (t.a23 - t.a12) * s31;
  const double p1 = t.a23 * (t.a13 - t.a23) * s12 - t.a12 * t.a12 * s23 -
                    2 * t.a12 * (blob * t.a23 + t.a13 * s23);
  const double p0 = t.a12 * (t.a12 * s23 - t.a23 * s12);
  const double g = CubicRoot(p2 / p3, p1 / p3, p0 / p3);
  Matrix3d conic;
  conic(0, 0) = t.a23 * (1 - g);
  conic(0, 1) = 0.5 * t.a23 * t.b12;
  conic(0, 2) = -0.5 * t.a23 * t.b13 * g;
  conic(1, 1) = t.a23 - t.a12 + t.a13 * g;
  conic(1, 2) = 0.5 * t.b23 * (t.a13 * g - t.a12);
  conic(2, 2) = g * (t.a13 - t.a23) - t.a12;
  conic(1, 0) = conic(0, 1);
  conic(2, 0) = conic(0, 2);
  conic(2, 1) = conic(1, 2);
  return conic;
}

// Unit eigenvector of a symmetric matrix, given the eigenvalue.
Vector3d EigenvectorOf(const Matrix3d& m, double value) {
  const double scale =
      1 / (value * (m(0, 0) + m(1, 1)) - m(0, 0) * m(1, 1) - value * value + m(0, 1) * m(0, 1));
  const double x = -(value * m(0, 2) + m(0, 1) * m(1, 2) - m(0, 2) * m(1, 1)) * scale;
  const double y = -(value * m(1, 2) + m(0, 1) * m(0, 2) - m(0, 0) * m(1, 2)) * scale;
  return Vector3d(x, y, 1) / std::sqrt(x * x + y * y + 1);
}

// Eigenvectors of the two eigenvalues that are not zero, larger first, and
// sqrt(-smaller / larger): the twist between the two lines of the degenerate conic.
bool DecomposeConic(const Matrix3d& m, Vector3d& v1, Vector3d& v2, double& twist) {
  const double trace = m.trace();
  const double minors = m(0, 0) * (m(1, 1) + m(2, 2)) + m(1, 1) * m(2, 2) - m(0, 1) * m(0, 1) -
                        m(0, 2) * m(0, 2) - m(1, 2) * m(1, 2);
  double e1, e2;
  if (!SolveQuadratic(-trace, minors, e1, e2)) return false;
  if (std::abs(e1) < std::abs(e2)) std::swap(e1, e2);
  v1 = EigenvectorOf(m, e1);
  v2 = EigenvectorOf(m, e2);
  const double ratio = -e2 / e1;
  twist = ratio > 0 ? std::sqrt(ratio) : 0.0;
  return v1.allFinite() && v2.allFinite() && std::isfinite(twist);
}

// Newton's method on the three equations: takes the last digits that the conic lost.
void RefineLengths(const Triangle& t, Vector3d& l) {
  for (int i = 0; i < 5; ++i) {
    const Vector3d residual(l[0] * l[0] + l[1] * l[1] + t.b12 * l[0] * l[1] - t.a12,
                            l[0] * l[0] + l[2] * l[2] + t.b13 * l[0] * l[2] - t.a13,
                            l[1] * l[1] + l[2] * l[2] + t.b23 * l[1] * l[2] - t.a23);
    if (residual.lpNorm<1>() < 1e-14 * (t.a12 + t.a13 + t.a23)) return;
    Matrix3d jacobian;
    jacobian << 2 * l[0] + t.b12 * l[1], 2 * l[1] + t.b12 * l[0], 0, 2 * l[0] + t.b13 * l[2], 0,
        2 * l[2] + t.b13 * l[0], 0, 2 * l[1] + t.b23 * l[2], 2 * l[2] + t.b23 * l[1];
    const Vector3d refined = l - jacobian.inverse() * residual;
    if (!refined.allFinite() || !(refined.minCoeff() > 0)) return;
    l = refined;
  }
}

// Lengths where one of the conic's lines, l1 = w0 l2 + w1 l3, meets the ellipses, [1] eq. (13).
int LengthsOnLine(const Triangle& t, const Vector3d& v1, const Vector3d& v2, double s,
                  Vector3d* lengths) {
  const double w2 = 1 / (s * v2[0] - v1[0]);
  const double w0 = (v1[1] - s * v2[1]) * w2;
  const double w1 = (v1[2] - s * v2[2]) * w2;
  const double a = 1 / ((t.a13 - t.a12) * w1 * w1 - t.a12 * t.b13 * w1 - t.a12);
  const double b = (t.a13 * t.b12 * w1 - t.a12 * t.b13 * w0 - 2 * w0 * w1 * (t.a12 - t.a13)) * a;
  const double c = ((t.a13 - t.a12) * w0 * w0 + t.a13 * t.b12 * w0 + t.a13) * a;
  double tau[2];
  if (!SolveQuadratic(b, c, tau[0], tau[1])) return 0;
  int found = 0;
  for (const double ratio : tau) {  // l3 = ratio * l2
    if (!(ratio > 0)) continue;
    const double l2 = std::sqrt(t.a23 / (ratio * (t.b23 + ratio) + 1));
    const Vector3d l(w0 * l2 + w1 * ratio * l2, l2, ratio * l2);
    if (l.allFinite() && l[0] >= 0) lengths[found++] = l;
  }
  return found;
}

// Orthonormal axes of a triangle: along its first side, in its plane, and across.
Matrix3d AxesOf(const Vector3d& side1, const Vector3d& side2) {
  Matrix3d axes;
  axes.col(0) = side1.normalized();
  axes.col(2) = side1.cross(side2).normalized();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return axes;
}

bool IsDegenerate(const Vector3d& d12, const Vector3d& d13) {
  return !(d12.cross(d13).squaredNorm() > kMinSineSquared * d12.squaredNorm() * d13.squaredNorm());
}

}  // namespace

int SolveP3p(const Bearings& y, const Points& x, std::array<Rigid3, kMaxP3pSolutions>& poses) {
  const Vector3d d12 = x[0] - x[1], d13 = x[0] - x[2], d23 = x[1] - x[2];
  if (IsDegenerate(d12, d13)) return 0;
  const Triangle t{d12.squaredNorm(),   d13.squaredNorm(),   d23.squaredNorm(),
                   -2 * y[0].dot(y[1]), -2 * y[0].dot(y[2]), -2 * y[1].dot(y[2])};
  Vector3d v1, v2;
  double twist;
  if (!DecomposeConic(DegenerateConic(t), v1, v2, twist)) return 0;
  std::array<Vector3d, kMaxP3pSolutions> lengths;
  int candidates = LengthsOnLine(t, v1, v2, twist, lengths.data());
  candidates += LengthsOnLine(t, v1, v2, -twist, lengths.data() + candidates);

  const Matrix3d world_from_axes = AxesOf(d12, d13);
  int found = 0;
  for (int i = 0; i < candidates; ++i) {
    RefineLengths(t, lengths[i]);
    const Vector3d first = lengths[i][0] * y[0];
    const Vector3d e12 = first - lengths[i][1] * y[1], e13 = first - lengths[i][2] * y[2];
    if (IsDegenerate(e12, e13)) continue;
    const Matrix3d rotation = AxesOf(e12, e13) * world_from_axes.transpose();
    Rigid3& pose = poses[found];
    pose.rotation = Eigen::Quaterniond(rotation).normalized();
    pose.translation = first - pose.rotation * x[0];
    if (pose.rotation.coeffs().allFinite() && pose.translation.allFinite()) ++found;
  }
  return found;
}

}  // namespace viewfix
