// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

namespace viewfix {

// One kernel, compiled for several processors: the build is for the least of them, and what
// the one at hand can do beyond that shows at run time only. Kernels are plain loops over
// integers, or over floats without a sum across lanes or a fused multiply-add, so all paths
// give the same bits. On ARM the build itself says what there is (NEON on 64 bits); only dot
// products of bytes have a path of their own.
enum class CpuPath {
  kPlain,
  kAvx2,
  kAvx512,
  kAvx512Vnni,  // and both dot products and tables of bytes (VNNI, VBMI): Ice Lake, Zen 4 and later
  kNeonDot,     // dot products of bytes: Cortex-A55, A75 and later
};

// The fastest path of this processor.
CpuPath BestCpuPath();
// All paths of this processor, plain first: tests compare them.
std::span<const CpuPath> CpuPathsHere();

// Clang 14 has no target of single functions for it.
#if defined(__aarch64__) && defined(__linux__) && !defined(__clang__)
#define VIEWFIX_NEON_DOT 1
#endif

// Kernel::Run is to be compiled into each path: VIEWFIX_KERNEL void Run(...).
#define VIEWFIX_KERNEL [[gnu::always_inline]] static inline

#if defined(__x86_64__)
template <typename Kernel, typename... Args>
[[gnu::target("avx2"), gnu::flatten]] void RunWithAvx2(Args... args) {
  Kernel::Run(args...);
}

#ifdef __clang__  // has no preferred width of vectors for one function alone
#define VIEWFIX_AVX512 "avx512f,avx512bw,avx512dq,avx512vl"
#else
#define VIEWFIX_AVX512 "avx512f,avx512bw,avx512dq,avx512vl,prefer-vector-width=512"
#endif

template <typename Kernel, typename... Args>
[[gnu::target(VIEWFIX_AVX512), gnu::flatten]] void RunWithAvx512(Args... args) {
  Kernel::Run(args...);
}
#endif

// Kernel::Run(args...), arguments by value, as compiled for `path`.
template <typename Kernel, typename... Args>
void RunOnPath([[maybe_unused]] CpuPath path, Args... args) {
#if defined(__x86_64__)
  if (path >= CpuPath::kAvx512) return RunWithAvx512<Kernel>(args...);
  if (path == CpuPath::kAvx2) return RunWithAvx2<Kernel>(args...);
#endif
  Kernel::Run(args...);
}

}  // namespace viewfix
