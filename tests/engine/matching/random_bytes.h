// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "tests/engine/image/test_image.h"

namespace viewfix {

// All values alike, -128 among them.
inline std::vector<std::int8_t> RandomBytes(int count, std::uint64_t seed) {
  TestRandom random(seed);
  std::vector<std::int8_t> bytes(count);
  for (std::int8_t& byte : bytes) byte = static_cast<std::int8_t>(random.Below(256) - 128);
  return bytes;
}

}  // namespace viewfix
