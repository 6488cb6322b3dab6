// SPDX-License-Identifier: BSD-3-Clause
#include "tests/testing/test_key.h"

#include <sodium.h>

#include <vector>

namespace viewfix {
namespace {

std::string Base64(const std::vector<std::uint8_t>& bytes) {
  constexpr int kVariant = sodium_base64_VARIANT_ORIGINAL;
  std::string text(sodium_base64_encoded_len(bytes.size(), kVariant), 0);
  sodium_bin2base64(text.data(), text.size(), bytes.data(), bytes.size(), kVariant);
  text.pop_back();
  return text;
}

template <typename Bytes>
std::vector<std::uint8_t> Join(const char* algorithm, const KeyId& id, const Bytes& bytes) {
  std::vector<std::uint8_t> all = {static_cast<std::uint8_t>(algorithm[0]),
                                   static_cast<std::uint8_t>(algorithm[1])};
  all.insert(all.end(), id.begin(), id.end());
  all.insert(all.end(), bytes.begin(), bytes.end());
  return all;
}

}  // namespace

TestKey::TestKey(int number) {
  std::array<std::uint8_t, 32> seed{};
  seed[0] = static_cast<std::uint8_t>(number);
  crypto_sign_ed25519_seed_keypair(open_.key.data(), secret_.data(), seed.data());
  open_.id[0] = static_cast<std::uint8_t>(number);
}

std::string TestKey::OpenText() const {
  return "untrusted comment: a test's\n" + Base64(Join("Ed", open_.id, open_.key)) + "\n";
}

std::string TestKey::Sign(std::span<const std::uint8_t> bytes, const ModelClaim& claim) const {
  const ContentHash hash = HashContent(bytes);
  std::array<std::uint8_t, 64> signature;
  crypto_sign_ed25519_detached(signature.data(), nullptr, hash.data(), hash.size(), secret_.data());
  const std::string comment = ClaimText(claim);
  std::vector<std::uint8_t> covered(signature.begin(), signature.end());
  covered.insert(covered.end(), comment.begin(), comment.end());
  std::vector<std::uint8_t> comment_signature(64);
  crypto_sign_ed25519_detached(comment_signature.data(), nullptr, covered.data(), covered.size(),
                               secret_.data());
  return "untrusted comment: a test's\n" + Base64(Join("ED", open_.id, signature)) +
         "\ntrusted comment: " + comment + "\n" + Base64(comment_signature) + "\n";
}

}  // namespace viewfix
