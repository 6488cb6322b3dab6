// SPDX-License-Identifier: BSD-3-Clause
#include "platform/store/flash_server.h"

#include <sodium.h>

#include <algorithm>
#include <vector>

#include "platform/camera/calibration.h"
#include "platform/file.h"

namespace viewfix {
namespace {

constexpr std::size_t kMaxProvisionedBytes = 1 << 20;

Status BadLine() { return {StatusCode::kCorrupt, "the other side does not speak viewfix-flash"}; }

Status TakeOffer(std::string_view line, ModelOffer& offer) {
  const auto words = Words(line);
  if (words.size() < 3 || words[0] != "model" || !ParseNumber(words[1], offer.size)) {
    return BadLine();
  }
  const Result<ContentHash> hash = ParseHash(words[2]);
  if (!hash.ok()) return hash.status();
  offer.hash = *hash;
  for (std::size_t i = 3; i < words.size(); ++i) {
    if (words[i] == "older") {
      offer.allow_older = true;
    } else if (words[i] == "other-site") {
      offer.allow_other_site = true;
    } else {
      return BadLine();
    }
  }
  return {};
}

// "NAME SIZE" and so many bytes.
Status TakeText(Conversation& talk, std::string_view size_word, std::size_t max_bytes,
                std::string& text) {
  std::uint64_t size = 0;
  if (!ParseNumber(size_word, size) || size > max_bytes) return BadLine();
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(size));
  if (Status status = talk.ReadExactly(bytes); !status.ok()) return status;
  text.assign(bytes.begin(), bytes.end());
  return {};
}

Status TakeTransfer(std::string_view line, Transfer& transfer) {
  const auto words = Words(line);
  if (words.size() != 4 || words[0] != "transfer" || !ParseNumber(words[2], transfer.size)) {
    return BadLine();
  }
  bool known = false;
  for (const Encoding encoding : {Encoding::kRaw, Encoding::kZstd, Encoding::kPatch}) {
    if (words[1] != EncodingName(encoding)) continue;
    transfer.encoding = encoding;
    known = true;
  }
  std::size_t size = 0;
  const bool hash = sodium_hex2bin(transfer.hash.data(), transfer.hash.size(), words[3].data(),
                                   words[3].size(), nullptr, &size, nullptr) == 0 &&
                    size == transfer.hash.size();
  return known && hash ? Status() : BadLine();
}

// Into the part's file as they come: what is here when the link breaks need not come again.
Status ReceivePart(Conversation& talk, Store& store, const Transfer& transfer) {
  Result<StoreFile> part = store.OpenPart(transfer);
  if (!part.ok()) return part.status();
  const Result<std::uint64_t> offset = part->Size();
  if (!offset.ok()) return offset.status();
  if (Status status = talk.WriteLine("offset " + std::to_string(*offset)); !status.ok()) {
    return status;
  }
  std::vector<std::uint8_t> buffer(65536);
  for (std::uint64_t left = transfer.size - std::min(*offset, transfer.size); left > 0;) {
    const std::size_t most = static_cast<std::size_t>(std::min<std::uint64_t>(left, buffer.size()));
    const Result<std::size_t> got = talk.ReadSome(std::span(buffer).first(most));
    if (!got.ok()) return got.status();
    if (*got == 0) return {StatusCode::kIo, "the link was closed before the model was whole"};
    if (Status status = part->Write(std::span(buffer).first(*got)); !status.ok()) return status;
    left -= *got;
  }
  return {};  // not flushed: Commit() hashes what it reads, and flushes what it puts in place
}

Status Install(Conversation& talk, Store& store, const FlashServerOptions& options) {
  ModelOffer offer;
  auto line = talk.ReadLine();
  if (!line.ok()) return line.status();
  if (Status status = TakeOffer(*line, offer); !status.ok()) return status;
  line = talk.ReadLine();
  if (!line.ok()) return line.status();
  const auto words = Words(*line);
  if (words.size() != 2 || words[0] != "signature") return BadLine();
  if (Status status = TakeText(talk, words[1], kMaxSignatureBytes, offer.signature); !status.ok()) {
    return status;
  }
  Transfer transfer;
  line = talk.ReadLine();
  if (!line.ok()) return line.status();
  if (Status status = TakeTransfer(*line, transfer); !status.ok()) return status;
  // A transfer is never longer than the model itself.
  if (transfer.size > offer.size) return BadLine();
  if (Status status = store.CheckOffer(offer); !status.ok()) return status;
  if (Status status = ReceivePart(talk, store, transfer); !status.ok()) return status;
  const Result<StoredModel> installed = store.Commit(offer, transfer, options.keep);
  if (!installed.ok()) return installed.status();
  return talk.WriteLine("installed " + installed->id);
}

std::span<const std::uint8_t> AsBytes(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

// Written beside its place, read as the daemon will read it, and only then put there.
Status PutCalibration(const std::string& folder, const std::string& text) {
  const std::string trial = folder + "/calibration.new.yaml";
  if (Status status = WriteFileAtomically(trial, AsBytes(text)); !status.ok()) return status;
  const auto read = ReadCalibration(trial);
  const auto files = OpenFolder(folder, false);
  if (!files.ok()) return files.status();
  if (!read.ok()) {
    (*files)->Unlink("calibration.new.yaml");
    return read.status();
  }
  return RenameStoreFile(**files, "calibration.new.yaml", "calibration.yaml");
}

Status Put(std::string_view what, const std::string& text, const FlashServerOptions& options) {
  const std::string& trust = options.trust_folder;
  const std::string above = trust.substr(0, std::min(trust.rfind('/'), trust.size()));
  std::string word = text;
  word.erase(word.find_last_not_of(" \r\n") + 1);
  if (what == "key") return AddKey(trust, text);
  if (what == "site") return SetSite(trust, word);
  if (what == "configuration") return WriteFileAtomically(above + "/viewfixd.toml", AsBytes(text));
  if (what == "calibration") return PutCalibration(above, text);
  if (what != "revoke") return BadLine();
  const Result<KeyId> id = ParseKeyId(word);
  return id.ok() ? RevokeKey(trust, *id) : id.status();
}

Status Provision(Conversation& talk, const FlashServerOptions& options) {
  while (true) {
    const auto line = talk.ReadLine();
    if (!line.ok()) return line.status();
    if (*line == "end") return talk.WriteLine("provisioned");
    const auto words = Words(*line);
    if (words.size() != 3 || words[0] != "file") return BadLine();
    std::string text;
    if (Status status = TakeText(talk, words[2], kMaxProvisionedBytes, text); !status.ok()) {
      return status;
    }
    if (Status status = Put(words[1], text, options); !status.ok()) return status;
  }
}

Status Serve(Conversation& talk, Store& store, const FlashServerOptions& options) {
  const auto greeting = talk.ReadLine();
  if (!greeting.ok()) return greeting.status();
  if (!greeting->starts_with(kFlashGreeting)) return BadLine();
  const std::string_view wish = std::string_view(*greeting).substr(kFlashGreeting.size());
  const Result<StoreState> state = store.State();
  if (!state.ok() && state.status().code() != StatusCode::kNotFound) return state.status();
  const bool has_model = state.ok() && !state->current.empty();
  const std::string hash = has_model ? HashText(state->current.hash) : "none";
  if (Status status = talk.WriteLine("board " + hash); !status.ok()) return status;
  if (wish == "install") return Install(talk, store, options);
  if (wish == "provision") return Provision(talk, options);
  return BadLine();
}

}  // namespace

std::string EncodingName(Encoding encoding) {
  if (encoding == Encoding::kRaw) return "raw";
  return encoding == Encoding::kZstd ? "zstd" : "patch";
}

std::string TransferHashText(const TransferHash& hash) {
  std::string text(2 * hash.size() + 1, 0);
  sodium_bin2hex(text.data(), text.size(), hash.data(), hash.size());
  text.pop_back();
  return text;
}

Status ServeFlash(ByteStream& stream, Store& store, const FlashServerOptions& options) {
  Conversation talk(stream);
  Status status = Serve(talk, store, options);
  if (!status.ok() && !talk.broken()) {
    std::string why(status.text());
    if (!status.detail().empty()) why.append(": ").append(status.detail());
    std::replace_if(
        why.begin(), why.end(), [](unsigned char c) { return c < 0x20; }, '?');
    static_cast<void>(talk.WriteLine("error " + why));
  }
  return status;
}

}  // namespace viewfix
