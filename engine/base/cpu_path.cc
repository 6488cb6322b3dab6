// SPDX-License-Identifier: BSD-3-Clause
#include "engine/base/cpu_path.h"

#include <array>
#include <cstddef>

#ifdef VIEWFIX_NEON_DOT
#include <sys/auxv.h>
#endif

namespace viewfix {
namespace {

#if defined(__x86_64__)
constexpr std::array kAllPaths = {CpuPath::kPlain, CpuPath::kAvx2, CpuPath::kAvx512,
                                  CpuPath::kAvx512Vnni};

std::size_t CountPaths() {
  if (!__builtin_cpu_supports("avx2")) return 1;
  const bool has_avx512 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                          __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
  if (!has_avx512) return 2;
  return __builtin_cpu_supports("avx512vnni") && __builtin_cpu_supports("avx512vbmi") ? 4 : 3;
}
#else
constexpr std::array kAllPaths = {CpuPath::kPlain, CpuPath::kNeonDot};

std::size_t CountPaths() {
#ifdef VIEWFIX_NEON_DOT
  constexpr unsigned long kDotProducts = 1UL << 20;  // HWCAP_ASIMDDP
  return (getauxval(AT_HWCAP) & kDotProducts) != 0 ? 2 : 1;
#else
  return 1;
#endif
}
#endif

}  // namespace

std::span<const CpuPath> CpuPathsHere() {
  static const std::size_t count = CountPaths();
  return {kAllPaths.data(), count};
}

CpuPath BestCpuPath() { return CpuPathsHere().back(); }

}  // namespace viewfix
