// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>

namespace viewfix {

// Rows that one descriptor is compared with at a time: what is loaded of it serves several dot
// products, and 4 sums fill the registers.
inline constexpr int kDotRows = 4;
// Longest descriptor.
inline constexpr int kMaxDescriptorDim = 128;

// descriptor'row for the rows of a block, exact.
//   descriptor [dim], rows [kDotRows, dim]: signed bytes, widened
//   kDim        the dimension where the compiler is to know it and needs no loop; 0: `dim` says
template <int kDim>
std::array<std::int32_t, kDotRows> DotBlock(const std::int16_t* descriptor,
                                            const std::int16_t* rows, int dim) {
  const int n = kDim > 0 ? kDim : dim;
  std::int32_t sum0 = 0, sum1 = 0, sum2 = 0, sum3 = 0;
  for (int i = 0; i < n; ++i) {
    sum0 += std::int32_t{descriptor[i]} * rows[i];
    sum1 += std::int32_t{descriptor[i]} * rows[n + i];
    sum2 += std::int32_t{descriptor[i]} * rows[2 * n + i];
    sum3 += std::int32_t{descriptor[i]} * rows[3 * n + i];
  }
  return {sum0, sum1, sum2, sum3};
}

}  // namespace viewfix
