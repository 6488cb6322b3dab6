// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>
#include <zstd.h>

#include <span>
#include <string>
#include <vector>

#include "models/model_writer.h"
#include "platform/store/store.h"
#include "tests/testing/test_key.h"
#include "tests/testing/tiny_model.h"

namespace viewfix {

// A model like no other of another number, of 100 kB or so: many blocks for a test to cut at.
inline std::vector<std::uint8_t> NumberedModel(int number) {
  ModelData data = TinyModelData();
  data.record = "{\"number\": " + std::to_string(number) + ", \"filler\": \"";
  for (std::uint32_t i = 0, x = 1; i < 96000; ++i, x = x * 1664525 + 1013904223) {
    data.record += static_cast<char>('a' + (x >> 28));
  }
  data.record += "\"}";
  Result<std::vector<std::uint8_t>> bytes = WriteModel(data);
  EXPECT_TRUE(bytes.ok());
  return *bytes;
}

inline Trust TrustIn(const TestKey& key) {
  Trust trust;
  trust.keys.push_back(key.open());
  return trust;
}

inline ModelOffer OfferOf(std::span<const std::uint8_t> model, const TestKey& key,
                          const ModelClaim& claim) {
  ModelOffer offer;
  offer.size = model.size();
  offer.hash = HashContent(model);
  offer.signature = key.Sign(model, claim);
  return offer;
}

// What travels for `model`, and how: as a patch of `base` if that is not empty.
struct Sent {
  Transfer transfer;
  std::vector<std::uint8_t> bytes;
};

inline Sent Send(std::span<const std::uint8_t> model, std::span<const std::uint8_t> base = {}) {
  Sent sent;
  sent.bytes.assign(model.begin(), model.end());
  if (!base.empty()) {
    sent.transfer.encoding = Encoding::kPatch;
    sent.bytes.resize(ZSTD_compressBound(model.size()));
    ZSTD_CCtx* const context = ZSTD_createCCtx();
    ZSTD_CCtx_setParameter(context, ZSTD_c_windowLog, 20);
    ZSTD_CCtx_refPrefix(context, base.data(), base.size());
    sent.bytes.resize(
        ZSTD_compress2(context, sent.bytes.data(), sent.bytes.size(), model.data(), model.size()));
    ZSTD_freeCCtx(context);
  }
  sent.transfer.size = sent.bytes.size();
  sent.transfer.hash = HashTransfer(sent.bytes);
  return sent;
}

// A whole install, from the first byte that is missing; in pieces, as a link gives them.
inline Result<StoredModel> Install(Store& store, const ModelOffer& offer, const Sent& sent,
                                   int keep = 2) {
  if (Status status = store.CheckOffer(offer); !status.ok()) return status;
  {
    Result<StoreFile> part = store.OpenPart(sent.transfer);
    if (!part.ok()) return part.status();
    const Result<std::uint64_t> offset = part->Size();
    if (!offset.ok()) return offset.status();
    auto rest = std::span(sent.bytes).subspan(static_cast<std::size_t>(*offset));
    while (!rest.empty()) {
      const auto piece = rest.first(std::min<std::size_t>(rest.size(), 16384));
      if (Status status = part->Write(piece); !status.ok()) return status;
      rest = rest.subspan(piece.size());
    }
  }
  return store.Commit(offer, sent.transfer, keep);
}

}  // namespace viewfix
