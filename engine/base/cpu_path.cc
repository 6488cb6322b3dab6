// SPDX-License-Identifier: BSD-3-Clause
#include "engine/base/cpu_path.h"

#include <array>
#include <cstddef>

namespace viewfix {
namespace {

constexpr std::array kAllPaths = {CpuPath::kPlain, CpuPath::kAvx2, CpuPath::kAvx512};

std::size_t CountPaths() {
#if defined(__x86_64__)
  if (!__builtin_cpu_supports("avx2")) return 1;
  const bool has_avx512 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                          __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
  return has_avx512 ? 3 : 2;
#else
  return 1;
#endif
}

}  // namespace

std::span<const CpuPath> CpuPathsHere() {
  static const std::size_t count = CountPaths();
  return {kAllPaths.data(), count};
}

CpuPath BestCpuPath() { return CpuPathsHere().back(); }

}  // namespace viewfix
