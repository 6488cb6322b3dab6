// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/common/content_hash.h"

namespace viewfix {

ContentHash::ContentHash() : state_() {
  crypto_generichash_init(&state_, nullptr, 0, sizeof(Hash256));
}

void ContentHash::Update(std::span<const std::uint8_t> bytes) {
  crypto_generichash_update(&state_, bytes.data(), bytes.size());
}

Hash256 ContentHash::Result() const {
  crypto_generichash_state state = state_;
  Hash256 hash;
  crypto_generichash_final(&state, hash.data(), hash.size());
  return hash;
}

std::string Hex(const Hash256& hash) {
  std::string text(2 * hash.size() + 1, '\0');
  sodium_bin2hex(text.data(), text.size(), hash.data(), hash.size());
  text.pop_back();
  return text;
}

}  // namespace viewfix
