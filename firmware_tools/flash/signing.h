// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "platform/store/minisign.h"

namespace viewfix {

// Keys and signatures as the minisign program makes them; either reads the other's.
struct SecretKey {
  KeyId id{};
  std::array<std::uint8_t, 64> key{};  // Ed25519: seed and public key
  SecretKey() = default;
  SecretKey(const SecretKey&) = default;
  SecretKey& operator=(const SecretKey&) = default;
  ~SecretKey();  // leaves no copy in memory
};

// How hard it is to try passwords on a stolen key file (scrypt): minisign's own, which takes 1 GiB
// of memory and some seconds. Tests take less.
struct PasswordCost {
  std::uint64_t operations = 33554432;
  std::uint64_t memory_bytes = std::uint64_t{1} << 30;
};

SecretKey GenerateKey();
PublicKey PublicKeyOf(const SecretKey& key);

// The files' texts. An empty password leaves the secret key unencrypted, as `minisign -W` does.
// Throws ToolError where scrypt cannot have the memory that it is to take.
std::string PublicKeyText(const PublicKey& key);
std::string SecretKeyText(const SecretKey& key, std::string_view password,
                          const PasswordCost& cost = {});

// Whether ReadSecretKey() will need a password. Both throw ToolError for a text that is no secret
// key; ReadSecretKey() also for a wrong password.
bool NeedsPassword(std::string_view text);
SecretKey ReadSecretKey(std::string_view text, std::string_view password);

// The signature's file. The same bytes, key and comment give the same text.
std::string SignatureText(std::span<const std::uint8_t> bytes, const SecretKey& key,
                          std::string_view trusted_comment);

}  // namespace viewfix
