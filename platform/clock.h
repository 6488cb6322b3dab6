// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <ctime>

namespace viewfix {

// Nanoseconds of CLOCK_MONOTONIC: the time base of frames and stages.
inline std::int64_t MonotonicNs() {
  timespec now = {};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

// Nanoseconds of CLOCK_BOOTTIME, which goes on while the machine sleeps.
inline std::int64_t BoottimeNs() {
  timespec now = {};
  clock_gettime(CLOCK_BOOTTIME, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

// How long the machine has slept since it started, but for the time between two readings.
inline std::int64_t SleptNs() { return BoottimeNs() - MonotonicNs(); }

// Nanoseconds since 1970-01-01 UTC: for people, it may jump.
inline std::int64_t WallClockNs() {
  timespec now = {};
  clock_gettime(CLOCK_REALTIME, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

}  // namespace viewfix
