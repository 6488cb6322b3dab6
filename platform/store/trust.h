// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "platform/store/minisign.h"
#include "platform/store/store_files.h"

namespace viewfix {

// Whom this board believes. A folder that only the board's administrator writes:
//   *.pub        public keys, as minisign writes them
//   revoked      one key's id a line: refused, though their file be there
//   site         the name of the site whose models the board takes
//   development  there, and unsigned models are taken
struct Trust {
  std::vector<PublicKey> keys;  // without the revoked ones
  std::vector<KeyId> revoked;
  std::string site;  // empty: the site of the first model
  bool development = false;
};

inline constexpr std::size_t kMaxTrustedKeys = 64;

// A folder that is not there trusts nobody. A file in it that cannot be read, or does not hold what
// it should, is an error: nothing is left out in silence.
Result<Trust> ReadTrust(const std::string& folder);

// Adds a key to the folder, made if it is not there; kInvalidArgument if it was revoked.
Status AddKey(const std::string& folder, const std::string& key_text);
// From now on nothing is believed that this key signed. kInvalidArgument: it is the last key.
Status RevokeKey(const std::string& folder, const KeyId& id);
Status SetSite(const std::string& folder, const std::string& site);

// The key that signed a file with this hash, if it is trusted. Errors name the key that it is not.
Status CheckSignature(const Trust& trust, const Signature& signature, const ContentHash& hash);

}  // namespace viewfix
