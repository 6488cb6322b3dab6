// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <string_view>

namespace viewfix::simulation {

// SplitMix64. Own draws instead of <random>'s distributions, whose results the
// standard leaves to each library: a seed must name the same museum everywhere.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) { Next(); }

  // An independent stream for the thing called `name`, so that adding one thing
  // to the museum leaves the others as they were.
  Random(std::uint64_t seed, std::string_view name) : state_(seed * 0x9e3779b97f4a7c15u) {
    for (const char c : name) state_ = (state_ ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
    Next();
  }

  std::uint64_t Next() {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }

  double Uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(Next() >> 11) * 0x1.0p-53;
  }
  // 0 .. n-1, n >= 1.
  int Below(int n) {
    return static_cast<int>((Next() >> 32) * static_cast<std::uint64_t>(n) >> 32);
  }
  bool Chance(double probability) { return Uniform(0, 1) < probability; }
  double Normal(double sigma) {
    const double u = Uniform(1e-12, 1), v = Uniform(0, 2 * std::numbers::pi);
    return sigma * std::sqrt(-2 * std::log(u)) * std::cos(v);
  }

 private:
  std::uint64_t state_;
};

}  // namespace viewfix::simulation
