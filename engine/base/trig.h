// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace viewfix {

// The few angles the engine needs, accurate to 1e-15: the same bits on every processor,
// which libm does not promise.

// Arc tangent of x >= 0. Reduction and minimax polynomial of fdlibm's s_atan.c.
constexpr double AtanOfNonNegative(double x) {
  double base = 0;
  double t = x;
  if (x >= 2.4375) {
    base = 1.57079632679489655800;  // pi / 2
    t = -1 / x;
  } else if (x >= 1.1875) {
    base = 0.98279372324732905408;  // atan 1.5
    t = (x - 1.5) / (1 + 1.5 * x);
  } else if (x >= 0.6875) {
    base = 0.78539816339744827900;  // atan 1
    t = (x - 1) / (1 + x);
  } else if (x >= 0.4375) {
    base = 0.46364760900080609352;  // atan 0.5
    t = (x - 0.5) / (1 + 0.5 * x);
  }
  constexpr double kCoefficients[] = {
      3.33333333333329318027e-01,  -1.99999999998764832476e-01, 1.42857142725034663711e-01,
      -1.11111104054623557880e-01, 9.09088713343650656196e-02,  -7.69187620504482999495e-02,
      6.66107313738753120669e-02,  -5.83357013379057348645e-02, 4.97687799461593236017e-02,
      -3.65315727442169155270e-02, 1.62858201153657823623e-02};
  const double t2 = t * t;
  double sum = 0;
  for (int i = 10; i >= 0; --i) sum = sum * t2 + kCoefficients[i];
  return base + (t - t * t2 * sum);
}

// Angle of (x, y) from the x axis, 0..pi, for y >= 0. Zero for (0, 0).
constexpr double Atan2OfNonNegative(double y, double x) {
  constexpr double kPi = 3.14159265358979323846;
  if (x > 0) return AtanOfNonNegative(y / x);
  if (x < 0) return kPi - AtanOfNonNegative(y / -x);
  return y > 0 ? kPi / 2 : 0;
}

struct SinCosValue {
  double sin, cos;
};

// Sine and cosine of an angle of -4..4 radians. Taylor series after subtracting quarter turns.
constexpr SinCosValue SinCos(double angle) {
  constexpr double kHalfPiHigh = 1.57079632679489655800;
  constexpr double kHalfPiLow = 6.12323399573676603587e-17;
  const int quarter = static_cast<int>(angle / kHalfPiHigh + (angle < 0 ? -0.5 : 0.5));
  const double r = (angle - quarter * kHalfPiHigh) - quarter * kHalfPiLow;
  const double r2 = r * r;
  double sine = 1;
  double cosine = 1;
  for (int n = 9; n >= 1; --n) {
    cosine = 1 - r2 * cosine / ((2 * n - 1) * (2 * n));
    sine = 1 - r2 * sine / ((2 * n) * (2 * n + 1));
  }
  sine *= r;
  switch (quarter & 3) {
    case 1:
      return {cosine, -sine};
    case 2:
      return {-sine, -cosine};
    case 3:
      return {-cosine, sine};
    default:
      return {sine, cosine};
  }
}

}  // namespace viewfix
