// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/flash/flash_client.h"

#include <zstd.h>

#include <algorithm>
#include <bit>
#include <utility>

#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/dataset/tool_file.h"
#include "platform/store/flash_server.h"

namespace viewfix {
namespace {

constexpr std::size_t kPieceBytes = 65536;
constexpr int kLevel = 3;  // compressing takes less time than a fast link saves
constexpr int kPatchLevel = 9;

// The board's last line says more than "broken pipe" does, and ssh's more than "closed".
[[noreturn]] void ThrowBroken(Conversation& talk, BoardLink& link, const Status& status) {
  if (status.code() == StatusCode::kIo) {
    const Result<std::string> line = talk.ReadLine();
    if (line.ok() && line->starts_with("error ")) throw ToolError(line->substr(6));
  }
  const std::string words = link.LastWords();
  if (status.code() == StatusCode::kCorrupt) {
    throw ToolError(Describe(status) + (words.empty() ? "" : ": " + words));
  }
  throw LinkBroke(words.empty() ? Describe(status) : words);
}

void Check(Conversation& talk, BoardLink& link, const Status& status) {
  if (!status.ok()) ThrowBroken(talk, link, status);
}

// The next line, without the word that it must begin with.
std::string Expect(Conversation& talk, BoardLink& link, const std::string& word) {
  const Result<std::string> line = talk.ReadLine();
  if (!line.ok()) ThrowBroken(talk, link, line.status());
  if (line->starts_with("error ")) throw ToolError(line->substr(6));
  if (*line == word) return {};
  if (!line->starts_with(word + " ")) {
    throw ToolError("the board does not speak viewfix-flash: " + *line);
  }
  return line->substr(word.size() + 1);
}

struct Packed {
  Transfer transfer;
  std::vector<std::uint8_t> bytes;
};

std::vector<std::uint8_t> Compress(const std::vector<std::uint8_t>& model,
                                   const std::vector<std::uint8_t>& base) {
  ZSTD_CCtx* const context = ZSTD_createCCtx();
  ZSTD_CCtx_setParameter(context, ZSTD_c_compressionLevel, base.empty() ? kLevel : kPatchLevel);
  if (!base.empty()) {
    // The window reaches from the model's end to the base's beginning.
    const int reach = static_cast<int>(std::bit_width(model.size() + base.size()));
    ZSTD_CCtx_setParameter(context, ZSTD_c_windowLog, std::clamp(reach, 10, 30));
    ZSTD_CCtx_setParameter(context, ZSTD_c_enableLongDistanceMatching, 1);
    ZSTD_CCtx_refPrefix(context, base.data(), base.size());
  }
  std::vector<std::uint8_t> bytes(ZSTD_compressBound(model.size()));
  const std::size_t size =
      ZSTD_compress2(context, bytes.data(), bytes.size(), model.data(), model.size());
  ZSTD_freeCCtx(context);
  if (ZSTD_isError(size) != 0) return model;
  bytes.resize(size);
  return bytes;
}

// Against a base, where it is not empty; as it is where that is no longer.
Packed Pack(const std::vector<std::uint8_t>& model, const std::vector<std::uint8_t>& base) {
  Packed packed;
  packed.bytes = Compress(model, base);
  packed.transfer.encoding = base.empty() ? Encoding::kZstd : Encoding::kPatch;
  if (packed.bytes.size() >= model.size()) {
    packed.bytes = model;
    packed.transfer.encoding = Encoding::kRaw;
  }
  packed.transfer.size = packed.bytes.size();
  packed.transfer.hash = HashTransfer(packed.bytes);
  return packed;
}

// The model that the board has, of those that are here; null: none of them.
const std::vector<std::uint8_t>* BaseOf(const FlashJob& job, const std::string& model_hash,
                                        const std::string& board_hash) {
  if (board_hash == model_hash) return &job.model;
  for (const auto& known : job.bases) {
    if (HashText(HashContent(known)) == board_hash) return &known;
  }
  return nullptr;
}

std::string OfferLine(const FlashJob& job, const std::string& model_hash) {
  std::string line = "model " + std::to_string(job.model.size()) + " " + model_hash;
  if (job.allow_older) line += " older";
  if (job.allow_other_site) line += " other-site";
  return line;
}

std::span<const std::uint8_t> AsBytes(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

}  // namespace

FlashOutcome FlashBoard(BoardLink& link, const FlashJob& job, const FlashProgress& progress) {
  Conversation talk(link);
  Check(talk, link, talk.WriteLine(std::string(kFlashGreeting) + "install"));
  // While the link comes about; most boards have no model that is here.
  const std::string model_hash = HashText(HashContent(job.model));
  Packed packed = Pack(job.model, {});
  const auto* base = BaseOf(job, model_hash, Expect(talk, link, "board"));
  if (base != nullptr) packed = Pack(job.model, *base);
  const Transfer& transfer = packed.transfer;
  Check(talk, link, talk.WriteLine(OfferLine(job, model_hash)));
  Check(talk, link, talk.WriteLine("signature " + std::to_string(job.signature.size())));
  Check(talk, link, talk.WriteBytes(AsBytes(job.signature)));
  Check(talk, link,
        talk.WriteLine("transfer " + EncodingName(transfer.encoding) + " " +
                       std::to_string(transfer.size) + " " + TransferHashText(transfer.hash)));
  FlashOutcome outcome;
  outcome.encoding = transfer.encoding;
  const std::string offset = Expect(talk, link, "offset");
  if (!ParseNumber(offset, outcome.resumed_at) || outcome.resumed_at > transfer.size) {
    throw ToolError("the board does not speak viewfix-flash: offset " + offset);
  }
  std::uint64_t at = outcome.resumed_at;
  if (progress) progress(at, transfer.size);
  while (at < transfer.size) {
    const std::size_t from = static_cast<std::size_t>(at);
    const std::size_t count = std::min(kPieceBytes, packed.bytes.size() - from);
    Check(talk, link, talk.WriteBytes(std::span(packed.bytes).subspan(from, count)));
    at += count;
    outcome.bytes_sent += count;
    if (progress) progress(at, transfer.size);
  }
  outcome.model_id = Expect(talk, link, "installed");
  return outcome;
}

void ProvisionBoard(BoardLink& link, const std::vector<ProvisionFile>& files) {
  Conversation talk(link);
  Check(talk, link, talk.WriteLine(std::string(kFlashGreeting) + "provision"));
  Expect(talk, link, "board");
  for (const ProvisionFile& file : files) {
    Check(talk, link, talk.WriteLine("file " + file.what + " " + std::to_string(file.text.size())));
    Check(talk, link, talk.WriteBytes(AsBytes(file.text)));
  }
  Check(talk, link, talk.WriteLine("end"));
  Expect(talk, link, "provisioned");
}

}  // namespace viewfix
