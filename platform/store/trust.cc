// SPDX-License-Identifier: BSD-3-Clause
#include "platform/store/trust.h"

#include <algorithm>

#include "platform/file.h"

namespace viewfix {
namespace {

constexpr std::size_t kMaxListBytes = 65536;
constexpr std::string_view kKeySuffix = ".pub";

bool Contains(const std::vector<KeyId>& ids, const KeyId& id) {
  return std::find(ids.begin(), ids.end(), id) != ids.end();
}

// The file's text without the spaces at its end; empty where there is no file.
Result<std::string> OptionalText(FileOps& files, const std::string& name, bool& there) {
  Result<std::string> text = ReadStoreText(files, name, kMaxListBytes);
  there = text.ok();
  if (!text.ok()) {
    if (text.status().code() == StatusCode::kNotFound) return std::string();
    return text.status();
  }
  text->erase(text->find_last_not_of(" \t\r\n") + 1);
  return text;
}

Status ReadRevoked(FileOps& files, Trust& trust) {
  bool there = false;
  const Result<std::string> text = OptionalText(files, "revoked", there);
  if (!text.ok()) return text.status();
  std::string_view rest = *text;
  while (!rest.empty()) {
    const std::size_t end = rest.find('\n');
    std::string_view line = rest.substr(0, end);
    rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
    if (line.ends_with('\r')) line.remove_suffix(1);
    if (line.empty()) continue;
    const Result<KeyId> id = ParseKeyId(line);
    if (!id.ok()) return AboutFile("revoked", id.status());
    trust.revoked.push_back(*id);
  }
  return {};
}

Status ReadKeys(FileOps& files, Trust& trust) {
  std::vector<std::string> names;
  if (files.List(names) != 0) return FileFault("cannot list", ".");
  std::sort(names.begin(), names.end());
  for (const std::string& name : names) {
    if (!name.ends_with(kKeySuffix)) continue;
    const Result<std::string> text = ReadStoreText(files, name, kMaxSignatureBytes);
    if (!text.ok()) return text.status();
    const Result<PublicKey> key = ParsePublicKey(*text);
    if (!key.ok()) return AboutFile(name, key.status());
    if (!Contains(trust.revoked, key->id)) trust.keys.push_back(*key);
    if (trust.keys.size() > kMaxTrustedKeys) {
      return {StatusCode::kResourceExhausted, "too many trusted keys", name};
    }
  }
  return {};
}

Status ReadFiles(FileOps& files, Trust& trust) {
  if (Status status = ReadRevoked(files, trust); !status.ok()) return status;
  if (Status status = ReadKeys(files, trust); !status.ok()) return status;
  bool there = false;
  const Result<std::string> site = OptionalText(files, "site", there);
  if (!site.ok()) return site.status();
  if (there && !ValidSiteName(*site)) return {StatusCode::kCorrupt, "no site's name", "site"};
  trust.site = *site;
  const Result<std::string> development = OptionalText(files, "development", trust.development);
  return development.ok() ? Status() : development.status();
}

}  // namespace

Result<Trust> ReadTrust(const std::string& folder) {
  Trust trust;
  const auto files = OpenFolder(folder, false);
  if (!files.ok()) {
    if (files.status().code() == StatusCode::kNotFound) return trust;
    return files.status();
  }
  if (Status status = ReadFiles(**files, trust); !status.ok()) return AboutFile(folder, status);
  return trust;
}

Status AddKey(const std::string& folder, const std::string& key_text) {
  const Result<PublicKey> key = ParsePublicKey(key_text);
  if (!key.ok()) return key.status();
  const auto files = OpenFolder(folder, true);
  if (!files.ok()) return files.status();
  const Result<Trust> trust = ReadTrust(folder);
  if (!trust.ok()) return trust.status();
  const std::string id = KeyIdText(key->id);
  if (Contains(trust->revoked, key->id)) {
    return {StatusCode::kInvalidArgument, "the key was revoked", id};
  }
  return ReplaceStoreText(**files, id + std::string(kKeySuffix), key_text);
}

Status RevokeKey(const std::string& folder, const KeyId& id) {
  const Result<Trust> trust = ReadTrust(folder);
  if (!trust.ok()) return trust.status();
  if (Contains(trust->revoked, id)) return {};
  const auto is_other = [&](const PublicKey& key) { return key.id != id; };
  if (std::none_of(trust->keys.begin(), trust->keys.end(), is_other)) {
    return {StatusCode::kInvalidArgument, "the last trusted key: add another before",
            KeyIdText(id)};
  }
  const auto files = OpenFolder(folder, false);
  if (!files.ok()) return files.status();
  std::string list;
  for (const KeyId& old : trust->revoked) list += KeyIdText(old) + "\n";
  return ReplaceStoreText(**files, "revoked", list + KeyIdText(id) + "\n");
}

Status SetSite(const std::string& folder, const std::string& site) {
  if (!ValidSiteName(site)) return {StatusCode::kInvalidArgument, "no site's name", site};
  const auto files = OpenFolder(folder, true);
  if (!files.ok()) return files.status();
  return ReplaceStoreText(**files, "site", site + "\n");
}

Status CheckSignature(const Trust& trust, const Signature& signature, const ContentHash& hash) {
  if (Contains(trust.revoked, signature.id)) {
    return {StatusCode::kInvalidArgument, "signed by a revoked key", KeyIdText(signature.id)};
  }
  for (const PublicKey& key : trust.keys) {
    if (key.id == signature.id) return VerifyHash(signature, key, hash);
  }
  return {StatusCode::kInvalidArgument, "signed by a key that this board does not trust",
          KeyIdText(signature.id)};
}

}  // namespace viewfix
