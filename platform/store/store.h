// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/status.h"
#include "platform/store/minisign.h"
#include "platform/store/pointer.h"
#include "platform/store/store_files.h"
#include "platform/store/trust.h"

namespace viewfix {

inline constexpr const char* kDefaultStore = "/var/lib/viewfix";
inline constexpr const char* kDefaultTrust = "/etc/viewfix/trust";
// A model that did not prove itself in so many starts that received frames is rolled back.
inline constexpr int kMaxTrialStarts = 3;

// A model on its way into the store, said before any of it is sent.
struct ModelOffer {
  std::uint64_t size = 0;  // bytes of the model
  ContentHash hash{};      // of the model
  std::string signature;   // the text of its .minisig; empty: unsigned
  bool allow_older = false;
  bool allow_other_site = false;
};

// How a model's bytes travel.
enum class Encoding {
  kRaw,    // as they are
  kZstd,   // compressed
  kPatch,  // compressed with the store's current model as zstd's prefix
};

using TransferHash = std::array<std::uint8_t, 32>;  // BLAKE2b-256
struct Transfer {
  Encoding encoding = Encoding::kRaw;
  std::uint64_t size = 0;  // bytes that travel
  TransferHash hash{};
};
TransferHash HashTransfer(std::span<const std::uint8_t> bytes);

struct ModelOfStore {
  std::vector<std::uint8_t> bytes;  // verified as this very buffer
  StoredModel model;
  std::string note;  // why it is not the one that the pointer names; empty: it is
};

// The board's models: a folder of
//   <id>.vfx, <id>.minisig  models and their signatures, at least the current and the last good one
//   pointer-0, pointer-1    which is which; the newer one that is whole counts
//   part-*                  transfers that were cut, to go on with
//   lock
// A power cut at any moment leaves the old model or the new one. Writers exclude each other by the
// lock; readers need none.
class Store {
 public:
  // Both are borrowed.
  Store(FileOps& files, const Trust& trust) : files_(files), trust_(trust) {}

  // kNotFound: no pointer, or none that is whole.
  Result<StoreState> State() const;

  // What must hold before a byte is written: a size that fits, a signature for just this hash by a
  // trusted key, this board's site, a version newer than any before. kInvalidArgument: it does not.
  Status CheckOffer(const ModelOffer& offer) const;

  // How much of a transfer is here already: where to go on.
  Result<std::uint64_t> PartSize(const Transfer& transfer) const;
  // Opens the part to go on at its end.
  Result<StoreFile> OpenPart(const Transfer& transfer);

  // The transfer is whole: decodes and verifies it, has the engine answer its golden queries, puts
  // it into its place and switches to it. The running model stays in all other cases.
  // Returns what is current then. Models beyond `keep` go, the current and last good ones never.
  Result<StoredModel> Commit(const ModelOffer& offer, const Transfer& transfer, int keep);

  // The current model or, where it is damaged or no longer trusted, the last good one, or else the
  // newest of any; a model on trial that has not proven itself is rolled back first.
  // kNotFound: there is none.
  Result<ModelOfStore> Load();

  // Whether this model is whole and trusted, as Load() would find it.
  Status Check(const StoredModel& model) const;

  Status CountStart(const StoredModel& model);  // one that received a frame
  Status Confirm(const StoredModel& model);
  // Back to the last good model. kNotFound: there is none.
  Result<StoredModel> Rollback();
  // Removes all models but `keep` (at least the current, the last good and the older pointer's),
  // and parts of transfers. Returns how many files went.
  Result<int> Gc(int keep);

  // The ids of all models that are here.
  Result<std::vector<std::string>> Models() const;

 private:
  Result<StoreState> ReadPointer(int which) const;
  Status WritePointer(StoreState state);
  // Changes the pointer under the lock, by what it says then.
  template <typename Change>
  Status Update(const Change& change);
  template <typename Change>
  Status UpdateLocked(const Change& change);
  Status CheckClaim(const ModelOffer& offer, const StoreState& state,
                    std::string_view comment) const;
  Result<std::vector<std::uint8_t>> Decode(const ModelOffer& offer, const Transfer& transfer,
                                           std::vector<std::uint8_t> bytes) const;
  Status PutInPlace(const ModelOffer& offer, const Transfer& transfer, const std::string& id,
                    std::span<const std::uint8_t> model);
  Status SwitchTo(const ModelOffer& offer, const StoredModel& model);  // under the lock
  // Reads and verifies all of a model. `hash`: that it must have; null: any that is signed.
  Result<ModelOfStore> LoadModel(const std::string& id, const ContentHash* hash) const;
  Result<ModelOfStore> LoadNewest() const;
  Status RemoveModels(int keep, const StoreState& state, int& removed);

  FileOps& files_;
  const Trust& trust_;
};

}  // namespace viewfix
