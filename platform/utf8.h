// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string_view>

namespace viewfix {

// Bytes of the UTF-8 sequence (RFC 3629) at the front of `text`, which is not empty; 0: there
// is none.
std::size_t Utf8Length(std::string_view text);

}  // namespace viewfix
