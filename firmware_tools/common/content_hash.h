// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sodium.h>

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

namespace viewfix {

using Hash256 = std::array<std::uint8_t, 32>;

// BLAKE2b-256 of a row of values: equal hashes, equal values, given the same row of Add()s.
class ContentHash {
 public:
  ContentHash();

  // As it stands in memory.
  template <typename T>
  requires(std::is_arithmetic_v<T> || std::is_enum_v<T>) void Add(T value) {
    Update({reinterpret_cast<const std::uint8_t*>(&value), sizeof(T)});
  }
  // With their number, so that "ab", "c" is not "a", "bc".
  template <typename T>
  requires(std::is_arithmetic_v<T>) void AddAll(std::span<const T> values) {
    Add(std::uint64_t{values.size()});
    Update({reinterpret_cast<const std::uint8_t*>(values.data()), values.size_bytes()});
  }
  void AddText(std::string_view text) { AddAll(std::span(text.data(), text.size())); }

  Hash256 Result() const;

 private:
  void Update(std::span<const std::uint8_t> bytes);

  crypto_generichash_state state_;
};

std::string Hex(const Hash256& hash);

}  // namespace viewfix
