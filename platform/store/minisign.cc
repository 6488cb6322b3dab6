// SPDX-License-Identifier: BSD-3-Clause
#include "platform/store/minisign.h"

#include <sodium.h>

#include <algorithm>
#include <charconv>
#include <vector>

namespace viewfix {
namespace {

constexpr std::string_view kSigned = "Ed";
constexpr std::string_view kSignedHash = "ED";
constexpr std::size_t kMaxCommentBytes = 1024;

Status NoSignature(const char* text) { return {StatusCode::kCorrupt, text}; }

// The text up to the next line end, which is taken off too.
std::string_view TakeLine(std::string_view& text) {
  const std::size_t end = text.find('\n');
  std::string_view line = text.substr(0, end);
  text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  return line;
}

bool Decode(std::string_view base64, std::span<std::uint8_t> bytes) {
  std::size_t size = 0;
  return sodium_base642bin(bytes.data(), bytes.size(), base64.data(), base64.size(), nullptr, &size,
                           nullptr, sodium_base64_VARIANT_ORIGINAL) == 0 &&
         size == bytes.size();
}

bool BeginsWith(std::span<const std::uint8_t> bytes, std::string_view magic) {
  return std::equal(magic.begin(), magic.end(), bytes.begin());
}

std::string Hex(std::span<const std::uint8_t> bytes) {
  std::string text(2 * bytes.size() + 1, 0);
  sodium_bin2hex(text.data(), text.size(), bytes.data(), bytes.size());
  text.pop_back();
  return text;
}

bool Unhex(std::string_view text, std::span<std::uint8_t> bytes) {
  std::size_t size = 0;
  return text.size() == 2 * bytes.size() &&
         sodium_hex2bin(bytes.data(), bytes.size(), text.data(), text.size(), nullptr, &size,
                        nullptr) == 0 &&
         size == bytes.size();
}

bool SignedBy(const std::array<std::uint8_t, 64>& signature, std::span<const std::uint8_t> message,
              const PublicKey& key) {
  return crypto_sign_ed25519_verify_detached(signature.data(), message.data(), message.size(),
                                             key.key.data()) == 0;
}

Status CheckSigned(const Signature& signature, const PublicKey& key,
                   std::span<const std::uint8_t> message) {
  if (signature.id != key.id) {
    return {StatusCode::kInvalidArgument, "signed by another key", KeyIdText(signature.id)};
  }
  if (!SignedBy(signature.signature, message, key)) {
    return NoSignature("the signature does not match the file");
  }
  std::vector<std::uint8_t> covered(signature.signature.begin(), signature.signature.end());
  covered.insert(covered.end(), signature.trusted_comment.begin(), signature.trusted_comment.end());
  if (!SignedBy(signature.comment_signature, covered, key)) {
    return NoSignature("the signature's trusted comment was changed");
  }
  return {};
}

}  // namespace

std::string KeyIdText(const KeyId& id) {
  KeyId big_endian = id;
  std::reverse(big_endian.begin(), big_endian.end());
  std::string text = Hex(big_endian);
  std::transform(text.begin(), text.end(), text.begin(),
                 [](char c) { return c >= 'a' ? static_cast<char>(c - 'a' + 'A') : c; });
  return text;
}

Result<KeyId> ParseKeyId(std::string_view text) {
  KeyId id;
  if (!Unhex(text, id)) {
    return Status(StatusCode::kInvalidArgument, "a key's id has 16 hexadecimal digits", text);
  }
  std::reverse(id.begin(), id.end());
  return id;
}

Result<PublicKey> ParsePublicKey(std::string_view text) {
  const Status fault = NoSignature("not a minisign public key");
  if (text.size() > kMaxSignatureBytes) return fault;
  std::string_view line = TakeLine(text);
  if (line.starts_with("untrusted comment:")) line = TakeLine(text);
  std::array<std::uint8_t, 42> bytes;
  if (!Decode(line, bytes) || !BeginsWith(bytes, kSigned)) return fault;
  PublicKey key;
  std::copy_n(bytes.begin() + 2, key.id.size(), key.id.begin());
  std::copy_n(bytes.begin() + 10, key.key.size(), key.key.begin());
  return key;
}

Result<Signature> ParseSignature(std::string_view text) {
  if (text.size() > kMaxSignatureBytes) return NoSignature("the signature is too long");
  if (!TakeLine(text).starts_with(kUntrustedPrefix)) {
    return NoSignature("not a minisign signature");
  }
  std::array<std::uint8_t, 74> bytes;
  if (!Decode(TakeLine(text), bytes)) return NoSignature("not a minisign signature");
  Signature signature;
  signature.prehashed = BeginsWith(bytes, kSignedHash);
  if (!signature.prehashed && !BeginsWith(bytes, kSigned)) {
    return NoSignature("the signature's algorithm is unknown");
  }
  std::copy_n(bytes.begin() + 2, signature.id.size(), signature.id.begin());
  std::copy_n(bytes.begin() + 10, signature.signature.size(), signature.signature.begin());
  const std::string_view comment = TakeLine(text);
  if (!comment.starts_with(kTrustedPrefix) || comment.size() > kMaxCommentBytes) {
    return NoSignature("the signature has no trusted comment");
  }
  signature.trusted_comment = comment.substr(kTrustedPrefix.size());
  if (!Decode(TakeLine(text), signature.comment_signature)) {
    return NoSignature("the signature is truncated");
  }
  return signature;
}

ContentHash HashContent(std::span<const std::uint8_t> bytes) {
  ContentHash hash;
  crypto_generichash(hash.data(), hash.size(), bytes.data(), bytes.size(), nullptr, 0);
  return hash;
}

std::string HashText(const ContentHash& hash) { return Hex(hash); }

Result<ContentHash> ParseHash(std::string_view text) {
  ContentHash hash;
  if (!Unhex(text, hash)) return Status(StatusCode::kCorrupt, "not a hash of 64 bytes");
  return hash;
}

Status VerifyHash(const Signature& signature, const PublicKey& key, const ContentHash& hash) {
  if (!signature.prehashed) {
    return {StatusCode::kUnsupported, "signed in minisign's old format: sign without -l"};
  }
  return CheckSigned(signature, key, hash);
}

Status VerifyContent(const Signature& signature, const PublicKey& key,
                     std::span<const std::uint8_t> bytes) {
  if (!signature.prehashed) return CheckSigned(signature, key, bytes);
  return CheckSigned(signature, key, HashContent(bytes));
}

bool ValidSiteName(std::string_view site) {
  const auto is_alphanumeric = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
  };
  const auto is_allowed = [&](char c) {
    return is_alphanumeric(c) || c == '.' || c == '_' || c == '-';
  };
  return !site.empty() && site.size() <= 64 && is_alphanumeric(site.front()) &&
         std::all_of(site.begin(), site.end(), is_allowed);
}

std::string ClaimText(const ModelClaim& claim) {
  return "site:" + claim.site + "\tversion:" + std::to_string(claim.version);
}

Result<ModelClaim> ParseClaim(std::string_view trusted_comment) {
  constexpr std::string_view kSite = "site:";
  constexpr std::string_view kVersion = "version:";
  ModelClaim claim;
  bool has_version = false;
  while (!trusted_comment.empty()) {
    const std::size_t tab = trusted_comment.find('\t');
    const std::string_view field = trusted_comment.substr(0, tab);
    trusted_comment.remove_prefix(tab == std::string_view::npos ? trusted_comment.size() : tab + 1);
    if (field.starts_with(kSite)) claim.site = field.substr(kSite.size());
    if (field.starts_with(kVersion)) {
      const char* end = field.data() + field.size();
      const auto read = std::from_chars(field.data() + kVersion.size(), end, claim.version);
      has_version = read.ec == std::errc() && read.ptr == end;
    }
  }
  if (!ValidSiteName(claim.site) || !has_version) {
    return NoSignature("the signature's trusted comment names no site and version");
  }
  return claim;
}

}  // namespace viewfix
