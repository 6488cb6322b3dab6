// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "engine/base/status.h"

namespace viewfix {

// Signatures in the format of minisign (https://jedisct1.github.io/minisign/): Ed25519 over the
// BLAKE2b-512 of the file; a second signature covers the first and its trusted comment.
inline constexpr std::size_t kMaxSignatureBytes = 4096;  // of a signature's or key's file
inline constexpr std::string_view kUntrustedPrefix = "untrusted comment: ";
inline constexpr std::string_view kTrustedPrefix = "trusted comment: ";

using KeyId = std::array<std::uint8_t, 8>;
using ContentHash = std::array<std::uint8_t, 64>;  // BLAKE2b-512

struct PublicKey {
  KeyId id{};
  std::array<std::uint8_t, 32> key{};
};

struct Signature {
  bool prehashed = false;  // false: minisign's old format, over the file itself
  KeyId id{};
  std::array<std::uint8_t, 64> signature{};
  std::string trusted_comment;
  std::array<std::uint8_t, 64> comment_signature{};
};

// 16 hexadecimal digits, as minisign shows a key's id.
std::string KeyIdText(const KeyId& id);
// kInvalidArgument: not 16 hexadecimal digits.
Result<KeyId> ParseKeyId(std::string_view text);

// A key's file, or its second line alone. kCorrupt: not a minisign public key.
Result<PublicKey> ParsePublicKey(std::string_view text);
// A signature's file. kCorrupt: not a minisign signature.
Result<Signature> ParseSignature(std::string_view text);

ContentHash HashContent(std::span<const std::uint8_t> bytes);
std::string HashText(const ContentHash& hash);  // 128 hexadecimal digits
Result<ContentHash> ParseHash(std::string_view text);

// Whether `key` made this signature for a file with this hash, trusted comment included.
// kCorrupt: it did not; kUnsupported: a signature in minisign's old format, which says nothing
// of a hash; kInvalidArgument: another key's.
Status VerifyHash(const Signature& signature, const PublicKey& key, const ContentHash& hash);
// The same of the whole file, in either format.
Status VerifyContent(const Signature& signature, const PublicKey& key,
                     std::span<const std::uint8_t> bytes);

// What the trusted comment of a model's signature says: "site:NAME\tversion:N".
struct ModelClaim {
  std::string site;
  std::uint64_t version = 0;  // grows from release to release of a site
};

// 1..64 letters, digits, '.', '_' or '-', the first a letter or digit.
bool ValidSiteName(std::string_view site);
std::string ClaimText(const ModelClaim& claim);
// kCorrupt: the comment names no site and version.
Result<ModelClaim> ParseClaim(std::string_view trusted_comment);

}  // namespace viewfix
