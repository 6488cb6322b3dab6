// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace viewfix {

// RFC 4648, padded.
std::string Base64(std::span<const std::uint8_t> bytes);

}  // namespace viewfix
