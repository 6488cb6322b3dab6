// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/common/base64.h"

#include <sodium.h>

namespace viewfix {

std::string Base64(std::span<const std::uint8_t> bytes) {
  constexpr int kVariant = sodium_base64_VARIANT_ORIGINAL;
  std::string text(sodium_base64_encoded_len(bytes.size(), kVariant), 0);
  sodium_bin2base64(text.data(), text.size(), bytes.data(), bytes.size(), kVariant);
  text.pop_back();  // its NUL
  return text;
}

}  // namespace viewfix
