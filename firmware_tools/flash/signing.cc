// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/flash/signing.h"

#include <sodium.h>

#include <algorithm>
#include <cstring>
#include <vector>

#include "firmware_tools/common/base64.h"
#include "firmware_tools/dataset/image_set.h"

namespace viewfix {
namespace {

// The secret key's file, behind its comment and base64; numbers are little endian.
//   0   "Ed"; 2 "Sc" (scrypt) or two zeros (no password); 4 "B2" (checked by BLAKE2b)
//   6   salt; 38 operations; 46 bytes of memory
//   54  under the password: 8 bytes of id, 64 of key, 32 of checksum
constexpr std::size_t kSaltAt = 6;
constexpr std::size_t kOperationsAt = 38;
constexpr std::size_t kMemoryAt = 46;
constexpr std::size_t kSecretAt = 54;
constexpr std::size_t kSecretBytes = 104;
constexpr std::size_t kChecksumAt = kSecretAt + 72;
constexpr std::size_t kFileBytes = kSecretAt + kSecretBytes;
constexpr std::uint64_t kMaxMemoryBytes = std::uint64_t{1} << 31;
constexpr std::uint64_t kMaxOperations = std::uint64_t{1} << 27;

using SecretFile = std::array<std::uint8_t, kFileBytes>;

std::string CommentedLine(std::string_view comment, std::span<const std::uint8_t> bytes) {
  std::string text(kUntrustedPrefix);
  return text.append(comment).append("\n").append(Base64(bytes)).append("\n");
}

template <typename Bytes>
std::vector<std::uint8_t> Join(std::string_view algorithm, const KeyId& id, const Bytes& bytes) {
  std::vector<std::uint8_t> all(algorithm.begin(), algorithm.end());
  all.insert(all.end(), id.begin(), id.end());
  all.insert(all.end(), bytes.begin(), bytes.end());
  return all;
}

// Of the algorithm, the id and the key.
std::array<std::uint8_t, 32> Checksum(const SecretFile& file) {
  std::array<std::uint8_t, 32> sum;
  crypto_generichash_state state;
  crypto_generichash_init(&state, nullptr, 0, sum.size());
  crypto_generichash_update(&state, file.data(), 2);
  crypto_generichash_update(&state, &file[kSecretAt], kChecksumAt - kSecretAt);
  crypto_generichash_final(&state, sum.data(), sum.size());
  return sum;
}

// Encrypts or decrypts, by adding the stream that the password gives.
void ApplyPassword(SecretFile& file, std::string_view password) {
  PasswordCost cost;
  std::memcpy(&cost.operations, &file[kOperationsAt], 8);
  std::memcpy(&cost.memory_bytes, &file[kMemoryAt], 8);
  if (cost.operations > kMaxOperations || cost.memory_bytes > kMaxMemoryBytes) {
    throw ToolError("the secret key asks for more time or memory than any key does");
  }
  std::array<std::uint8_t, kSecretBytes> stream;
  if (crypto_pwhash_scryptsalsa208sha256(stream.data(), stream.size(), password.data(),
                                         password.size(), &file[kSaltAt], cost.operations,
                                         cost.memory_bytes) != 0) {
    throw ToolError("not enough memory for the secret key's password (" +
                    std::to_string(cost.memory_bytes >> 20) + " MiB)");
  }
  for (std::size_t i = 0; i < stream.size(); ++i) file[kSecretAt + i] ^= stream[i];
  sodium_memzero(stream.data(), stream.size());
}

SecretFile DecodeSecretFile(std::string_view text) {
  const std::size_t end = text.find('\n');
  std::string_view line = end == std::string_view::npos ? "" : text.substr(end + 1);
  line = line.substr(0, line.find_first_of("\r\n"));
  SecretFile file;
  std::size_t size = 0;
  const bool whole = text.starts_with("untrusted comment:") &&
                     sodium_base642bin(file.data(), file.size(), line.data(), line.size(), nullptr,
                                       &size, nullptr, sodium_base64_VARIANT_ORIGINAL) == 0 &&
                     size == file.size() && std::memcmp(file.data(), "Ed", 2) == 0 &&
                     std::memcmp(&file[4], "B2", 2) == 0;
  const bool known = whole && (std::memcmp(&file[2], "Sc", 2) == 0 || (file[2] | file[3]) == 0);
  if (!known) throw ToolError("not a minisign secret key");
  return file;
}

}  // namespace

SecretKey::~SecretKey() { sodium_memzero(key.data(), key.size()); }

SecretKey GenerateKey() {
  if (sodium_init() < 0) throw ToolError("no source of random numbers");
  SecretKey key;
  std::array<std::uint8_t, 32> public_key;
  randombytes_buf(key.id.data(), key.id.size());
  crypto_sign_ed25519_keypair(public_key.data(), key.key.data());
  return key;
}

PublicKey PublicKeyOf(const SecretKey& key) {
  PublicKey result;
  result.id = key.id;
  crypto_sign_ed25519_sk_to_pk(result.key.data(), key.key.data());
  return result;
}

std::string PublicKeyText(const PublicKey& key) {
  return CommentedLine("minisign public key " + KeyIdText(key.id), Join("Ed", key.id, key.key));
}

std::string SecretKeyText(const SecretKey& key, std::string_view password,
                          const PasswordCost& cost) {
  if (sodium_init() < 0) throw ToolError("no source of random numbers");
  SecretFile file{};
  std::memcpy(file.data(), "Ed", 2);
  std::memcpy(&file[4], "B2", 2);
  std::copy(key.id.begin(), key.id.end(), &file[kSecretAt]);
  std::copy(key.key.begin(), key.key.end(), &file[kSecretAt + key.id.size()]);
  const auto sum = Checksum(file);
  std::copy(sum.begin(), sum.end(), &file[kChecksumAt]);
  if (!password.empty()) {
    std::memcpy(&file[2], "Sc", 2);
    randombytes_buf(&file[kSaltAt], kOperationsAt - kSaltAt);
    std::memcpy(&file[kOperationsAt], &cost.operations, 8);
    std::memcpy(&file[kMemoryAt], &cost.memory_bytes, 8);
    ApplyPassword(file, password);
  }
  std::string text = CommentedLine(password.empty() ? "minisign unencrypted secret key (viewfix)"
                                                    : "minisign encrypted secret key (viewfix)",
                                   file);
  sodium_memzero(file.data(), file.size());
  return text;
}

bool NeedsPassword(std::string_view text) { return DecodeSecretFile(text)[2] != 0; }

SecretKey ReadSecretKey(std::string_view text, std::string_view password) {
  SecretFile file = DecodeSecretFile(text);
  const bool encrypted = file[2] != 0;
  if (encrypted) ApplyPassword(file, password);
  const auto sum = Checksum(file);
  // `minisign -W` writes none.
  const bool has_sum = encrypted || sodium_is_zero(&file[kChecksumAt], sum.size()) == 0;
  if (has_sum && sodium_memcmp(sum.data(), &file[kChecksumAt], sum.size()) != 0) {
    throw ToolError(encrypted ? "wrong password for the secret key"
                              : "the secret key is damaged (its checksum does not match)");
  }
  SecretKey key;
  std::copy_n(&file[kSecretAt], key.id.size(), key.id.begin());
  std::copy_n(&file[kSecretAt + key.id.size()], key.key.size(), key.key.begin());
  sodium_memzero(file.data(), file.size());
  return key;
}

std::string SignatureText(std::span<const std::uint8_t> bytes, const SecretKey& key,
                          std::string_view trusted_comment) {
  const ContentHash hash = HashContent(bytes);
  std::array<std::uint8_t, 64> signature;
  crypto_sign_ed25519_detached(signature.data(), nullptr, hash.data(), hash.size(), key.key.data());
  std::vector<std::uint8_t> covered(signature.begin(), signature.end());
  covered.insert(covered.end(), trusted_comment.begin(), trusted_comment.end());
  std::array<std::uint8_t, 64> comment_signature;
  crypto_sign_ed25519_detached(comment_signature.data(), nullptr, covered.data(), covered.size(),
                               key.key.data());
  return CommentedLine("signature from viewfix", Join("ED", key.id, signature)) +
         std::string(kTrustedPrefix) + std::string(trusted_comment) + "\n" +
         Base64(comment_signature) + "\n";
}

}  // namespace viewfix
