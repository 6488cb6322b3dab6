// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bit>
#include <cstdint>

namespace viewfix {

// e^x to within 2 units in the last place for |x| < 700, 0 below and e^700 above: the same
// bits on every processor, which libm does not promise. Reduction x = k ln2 + r with
// |r| <= ln2 / 2, Taylor series of e^r, exact scaling by 2^k.
constexpr double Exp(double x) {
  if (!(x > -700.0)) return 0.0;
  if (x > 700.0) x = 700.0;
  constexpr double kInvLn2 = 1.4426950408889634;
  constexpr double kLn2High = 6.93147180369123816490e-01;  // low bits zero: k * high is exact
  constexpr double kLn2Low = 1.90821492927058770002e-10;
  const auto k = static_cast<std::int64_t>(x * kInvLn2 + (x < 0 ? -0.5 : 0.5));
  const double r = (x - static_cast<double>(k) * kLn2High) - static_cast<double>(k) * kLn2Low;
  double sum = 1.0;
  for (int n = 14; n >= 1; --n) sum = 1.0 + sum * r / n;
  return sum * std::bit_cast<double>((std::uint64_t{1023} + static_cast<std::uint64_t>(k)) << 52);
}

}  // namespace viewfix
