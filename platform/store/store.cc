// SPDX-License-Identifier: BSD-3-Clause
#include "platform/store/store.h"

#include <fcntl.h>
#include <sodium.h>
#include <unistd.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <ctime>
#include <set>
#include <utility>

#include "models/model_view.h"
#include "platform/file.h"
#include "platform/store/golden.h"

namespace viewfix {
namespace {

constexpr std::array<const char*, 2> kPointers = {"pointer-0", "pointer-1"};
constexpr std::string_view kModelSuffix = ".vfx";
constexpr std::string_view kSignatureSuffix = ".minisig";
constexpr const char* kNotSigned = "the model is not signed";
constexpr std::string_view kPartPrefix = "part-";
constexpr std::string_view kTemporaryPrefix = "tmp-";
// Left free beside the model: pointers, a signature, what else the disk is for.
constexpr std::uint64_t kSpareBytes = 1 << 20;

std::string ModelFile(const std::string& id) { return id + std::string(kModelSuffix); }
std::string SignatureFile(const std::string& id) { return id + std::string(kSignatureSuffix); }

std::string PartFile(const Transfer& transfer) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string name(kPartPrefix);
  for (int i = 0; i < 16; ++i) {
    name += kDigits[transfer.hash[i] >> 4];
    name += kDigits[transfer.hash[i] & 15];
  }
  return name;
}

// Held for the few milliseconds that a pointer takes to change.
class StoreLock {
 public:
  explicit StoreLock(FileOps& files) : files_(files) {
    constexpr int kTries = 500;
    constexpr timespec kPause = {0, 10'000'000};
    for (int i = 0; i < kTries; ++i) {
      fd_ = files_.Lock();
      if (fd_ >= 0 || errno != EWOULDBLOCK) break;
      nanosleep(&kPause, nullptr);
    }
    if (fd_ < 0) {
      status_ = errno == EWOULDBLOCK
                    ? Status(StatusCode::kIo, "the store is locked by another process")
                    : FileFault("cannot lock the store", "lock");
    }
  }
  ~StoreLock() {
    if (fd_ >= 0) files_.Close(fd_);
  }
  StoreLock(const StoreLock&) = delete;
  StoreLock& operator=(const StoreLock&) = delete;
  const Status& status() const { return status_; }

 private:
  FileOps& files_;
  int fd_ = -1;
  Status status_;
};

// Decodes into memory of the size that was announced, and signed for, and no more.
Result<std::vector<std::uint8_t>> Decompress(std::span<const std::uint8_t> bytes,
                                             std::span<const std::uint8_t> prefix,
                                             std::uint64_t size) {
  const Status fault(StatusCode::kCorrupt, "the compressed model is damaged");
  if (ZSTD_getFrameContentSize(bytes.data(), bytes.size()) != size) return fault;
  ZSTD_DCtx* const context = ZSTD_createDCtx();
  if (context == nullptr) return Status(StatusCode::kResourceExhausted, "not enough memory");
  ZSTD_DCtx_setParameter(context, ZSTD_d_windowLogMax, sizeof(void*) == 4 ? 30 : 31);
  ZSTD_DCtx_refPrefix(context, prefix.data(), prefix.size());
  std::vector<std::uint8_t> model(static_cast<std::size_t>(size));
  const std::size_t got =
      ZSTD_decompressDCtx(context, model.data(), model.size(), bytes.data(), bytes.size());
  ZSTD_freeDCtx(context);
  if (ZSTD_isError(got) != 0 || got != model.size()) return fault;
  return model;
}

void Remember(std::vector<ModelClaim>& newest, const ModelClaim& claim) {
  for (ModelClaim& known : newest) {
    if (known.site != claim.site) continue;
    known.version = std::max(known.version, claim.version);
    return;
  }
  if (newest.size() == kMaxSites) newest.erase(newest.begin());
  newest.push_back(claim);
}

}  // namespace

TransferHash HashTransfer(std::span<const std::uint8_t> bytes) {
  TransferHash hash;
  crypto_generichash(hash.data(), hash.size(), bytes.data(), bytes.size(), nullptr, 0);
  return hash;
}

Result<StoreState> Store::ReadPointer(int which) const {
  const Result<std::string> text = ReadStoreText(files_, kPointers[which], kMaxPointerBytes);
  if (!text.ok()) return text.status();
  Result<StoreState> state = ParsePointer(*text);
  if (!state.ok()) return AboutFile(kPointers[which], state.status());
  return state;
}

Result<StoreState> Store::State() const {
  Result<StoreState> first = ReadPointer(0);
  Result<StoreState> second = ReadPointer(1);
  if (!first.ok() && !second.ok()) {
    // A file that is there and cannot be read must not look like an empty store.
    for (const Result<StoreState>* state : {&first, &second}) {
      if (state->status().code() == StatusCode::kIo) return state->status();
    }
    return Status(StatusCode::kNotFound, "the store has no model");
  }
  if (!second.ok()) return first;
  if (!first.ok()) return second;
  return first->generation > second->generation ? first : second;
}

Status Store::WritePointer(StoreState state) {
  ++state.generation;
  return ReplaceStoreText(files_, kPointers[state.generation % 2], PointerText(state));
}

template <typename Change>
Status Store::Update(const Change& change) {
  const StoreLock lock(files_);
  return lock.status().ok() ? UpdateLocked(change) : lock.status();
}

template <typename Change>
Status Store::UpdateLocked(const Change& change) {
  Result<StoreState> state = State();
  if (!state.ok() && state.status().code() != StatusCode::kNotFound) return state.status();
  StoreState next = state.ok() ? *state : StoreState();
  const Result<bool> changed = change(next);
  if (!changed.ok()) return changed.status();
  return *changed ? WritePointer(next) : Status();
}

Status Store::CheckClaim(const ModelOffer& offer, const StoreState& state,
                         std::string_view comment) const {
  const Result<ModelClaim> claim = ParseClaim(comment);
  if (!claim.ok()) return claim.status();
  const std::string site = !trust_.site.empty()   ? trust_.site
                           : state.newest.empty() ? claim->site
                                                  : state.newest.back().site;
  if (claim->site != site && !offer.allow_other_site) {
    return {StatusCode::kInvalidArgument, "a model of another site",
            claim->site + ", while this board is at " + site};
  }
  const ModelClaim* newest = state.NewestOf(claim->site);
  const bool is_newer = newest == nullptr || claim->version > newest->version ||
                        (claim->version == newest->version && offer.hash == state.current.hash);
  if (is_newer || offer.allow_older) return {};
  return {StatusCode::kInvalidArgument, "an older model, or another of the same version",
          "version " + std::to_string(claim->version) + ", while this board had " +
              std::to_string(newest->version)};
}

Status Store::CheckOffer(const ModelOffer& offer) const {
  if (offer.size < kModelHeaderBytes || offer.size > kMaxFileBytes) {
    return {StatusCode::kResourceExhausted, "no model has this size",
            std::to_string(offer.size) + " bytes"};
  }
  if (offer.signature.empty()) {
    if (trust_.development) return {};
    return {StatusCode::kInvalidArgument, kNotSigned};
  }
  const Result<Signature> signature = ParseSignature(offer.signature);
  if (!signature.ok()) return signature.status();
  if (Status status = CheckSignature(trust_, *signature, offer.hash); !status.ok()) {
    return trust_.development ? Status() : status;
  }
  const Result<StoreState> state = State();
  if (!state.ok() && state.status().code() != StatusCode::kNotFound) return state.status();
  return CheckClaim(offer, state.ok() ? *state : StoreState(), signature->trusted_comment);
}

Result<std::uint64_t> Store::PartSize(const Transfer& transfer) const {
  const Result<StoreFile> file = StoreFile::Open(files_, PartFile(transfer), O_RDONLY);
  if (!file.ok()) {
    if (file.status().code() == StatusCode::kNotFound) return std::uint64_t{0};
    return file.status();
  }
  return file->Size();
}

Result<StoreFile> Store::OpenPart(const Transfer& transfer) {
  const Result<std::uint64_t> size = PartSize(transfer);
  if (!size.ok()) return size.status();
  if (*size > transfer.size) files_.Unlink(PartFile(transfer));
  const std::uint64_t missing = transfer.size - std::min(*size, transfer.size);
  const std::int64_t free = files_.FreeBytes();
  if (free >= 0 && std::uint64_t(free) < missing + kSpareBytes) {
    return Status(StatusCode::kResourceExhausted, "the disk is too full for the model",
                  std::to_string(free) + " bytes are free");
  }
  Result<StoreFile> file = StoreFile::Open(files_, PartFile(transfer), O_WRONLY | O_CREAT);
  if (!file.ok()) return file.status();
  if (const auto end = file->SeekEnd(); !end.ok()) return end.status();
  return file;
}

Result<std::vector<std::uint8_t>> Store::Decode(const ModelOffer& offer, const Transfer& transfer,
                                                std::vector<std::uint8_t> bytes) const {
  if (transfer.encoding == Encoding::kRaw) return bytes;
  std::vector<std::uint8_t> base;
  if (transfer.encoding == Encoding::kPatch) {
    const Result<StoreState> state = State();
    if (!state.ok()) return state.status();
    auto read = ReadStoreFile(files_, ModelFile(state->current.id), kMaxFileBytes);
    if (!read.ok()) return read.status();
    base = std::move(*read);
  }
  return Decompress(bytes, base, offer.size);
}

// The file first, then its name: a name stands for a whole model at any time.
Status Store::PutInPlace(const ModelOffer& offer, const Transfer& transfer, const std::string& id,
                         std::span<const std::uint8_t> model) {
  if (offer.signature.empty()) {
    files_.Unlink(SignatureFile(id));
  } else if (Status status = ReplaceStoreText(files_, SignatureFile(id), offer.signature);
             !status.ok()) {
    return status;
  }
  if (transfer.encoding != Encoding::kRaw) return ReplaceStoreFile(files_, ModelFile(id), model);
  Result<StoreFile> part = StoreFile::Open(files_, PartFile(transfer), O_WRONLY);
  if (!part.ok()) return part.status();
  if (Status status = part->Finish(); !status.ok()) return status;
  return RenameStoreFile(files_, PartFile(transfer), ModelFile(id));
}

Status Store::SwitchTo(const ModelOffer& offer, const StoredModel& model) {
  // The offer is judged once more, by what the pointer says under the lock.
  return UpdateLocked([&](StoreState& state) -> Result<bool> {
    const Result<Signature> signature = ParseSignature(offer.signature);
    const bool trusted = signature.ok() && CheckSignature(trust_, *signature, offer.hash).ok();
    if (trusted) {
      if (Status status = CheckClaim(offer, state, signature->trusted_comment); !status.ok()) {
        return status;
      }
      if (const auto claim = ParseClaim(signature->trusted_comment); claim.ok()) {
        Remember(state.newest, *claim);
      }
    }
    if (state.current == model) return true;  // signed anew
    // A model on trial that gives way to the next was never proven: the last good one stays.
    if (state.confirmed || state.previous.empty()) state.previous = state.current;
    state.current = model;
    state.confirmed = false;
    state.starts = 0;
    state.rejected.clear();
    return true;
  });
}

Result<StoredModel> Store::Commit(const ModelOffer& offer, const Transfer& transfer, int keep) {
  if (Status status = CheckOffer(offer); !status.ok()) return status;
  const std::string part = PartFile(transfer);
  auto bytes = ReadStoreFile(files_, part, kMaxFileBytes);
  if (!bytes.ok()) return bytes.status();
  const auto refuse = [&](const Status& status) {
    files_.Unlink(part);  // it would be as wrong the next time
    return status;
  };
  if (bytes->size() != transfer.size || HashTransfer(*bytes) != transfer.hash) {
    return refuse({StatusCode::kCorrupt, "the transfer was damaged: send it again"});
  }
  const auto model = Decode(offer, transfer, std::move(*bytes));
  if (!model.ok()) return refuse(model.status());
  if (model->size() != offer.size || HashContent(*model) != offer.hash) {
    return refuse({StatusCode::kCorrupt, "the model is not the one that was announced"});
  }
  const Result<ModelView> view = ModelView::Open(*model);
  if (!view.ok()) return refuse(view.status());
  if (Status status = SelfTest(*view); !status.ok()) return refuse(status);
  const auto id = view->short_hash();
  const StoredModel stored{{id.data(), id.size()}, offer.hash};
  {
    const StoreLock lock(files_);
    if (!lock.status().ok()) return lock.status();
    if (Status status = PutInPlace(offer, transfer, stored.id, *model); !status.ok()) return status;
    if (Status status = SwitchTo(offer, stored); !status.ok()) return status;
  }
  if (transfer.encoding != Encoding::kRaw) files_.Unlink(part);
  static_cast<void>(Gc(keep));  // what it leaves, the next one takes
  return stored;
}

Result<ModelOfStore> Store::LoadModel(const std::string& id, const ContentHash* hash) const {
  auto bytes = ReadStoreFile(files_, ModelFile(id), kMaxFileBytes);
  if (!bytes.ok()) return bytes.status();
  ModelOfStore loaded{std::move(*bytes), {id, {}}, {}};
  loaded.model.hash = HashContent(loaded.bytes);
  if (hash != nullptr && loaded.model.hash != *hash) {
    return Status(StatusCode::kCorrupt, "not the model that was installed", ModelFile(id));
  }
  if (!trust_.development) {
    const auto text = ReadStoreText(files_, SignatureFile(id), kMaxSignatureBytes);
    if (text.status().code() == StatusCode::kNotFound) {
      return Status(StatusCode::kNotFound, kNotSigned, ModelFile(id));
    }
    if (!text.ok()) return text.status();
    const Result<Signature> signature = ParseSignature(*text);
    if (!signature.ok()) return AboutFile(SignatureFile(id), signature.status());
    if (Status status = CheckSignature(trust_, *signature, loaded.model.hash); !status.ok()) {
      return AboutFile(ModelFile(id), status);
    }
  }
  const Result<ModelView> view = ModelView::Open(loaded.bytes);
  if (!view.ok()) return AboutFile(ModelFile(id), view.status());
  return loaded;
}

// Where no pointer leads: the highest version that is whole, of this board's site.
Result<ModelOfStore> Store::LoadNewest() const {
  const Result<std::vector<std::string>> ids = Models();
  if (!ids.ok()) return ids.status();
  Result<ModelOfStore> best = Status(StatusCode::kNotFound, "the store has no model");
  std::uint64_t best_version = 0;
  for (const std::string& id : *ids) {
    Result<ModelOfStore> loaded = LoadModel(id, nullptr);
    if (!loaded.ok()) continue;
    ModelClaim claim;
    const auto text = ReadStoreText(files_, SignatureFile(id), kMaxSignatureBytes);
    if (text.ok()) {
      const Result<Signature> signature = ParseSignature(*text);
      if (signature.ok()) {
        const auto said = ParseClaim(signature->trusted_comment);
        if (said.ok()) claim = *said;
      }
    }
    if (!trust_.site.empty() && claim.site != trust_.site && !trust_.development) continue;
    if (best.ok() && claim.version <= best_version) continue;
    best_version = claim.version;
    best = std::move(loaded);
  }
  return best;
}

Result<ModelOfStore> Store::Load() {
  const Result<StoreState> state = State();
  if (!state.ok()) {
    if (state.status().code() != StatusCode::kNotFound) return state.status();
    Result<ModelOfStore> newest = LoadNewest();
    if (newest.ok()) newest->note = "the store's pointer is lost: took the newest model";
    return newest;
  }
  std::string note;
  StoredModel wanted = state->current;
  StoredModel other = state->previous;
  if (!state->confirmed && state->starts >= kMaxTrialStarts && !other.empty()) {
    note = "model " + wanted.id + " has not proven itself in " + std::to_string(state->starts) +
           " starts: rolled back to " + other.id;
    if (const auto back = Rollback(); !back.ok()) note += " (for now: the store cannot be written)";
    std::swap(wanted, other);
  }
  Result<ModelOfStore> loaded = LoadModel(wanted.id, &wanted.hash);
  if (!loaded.ok()) {
    const Status fault = loaded.status();
    note = std::string(fault.text()) + ": " + std::string(fault.detail());
    if (!other.empty()) loaded = LoadModel(other.id, &other.hash);
    if (!loaded.ok()) loaded = LoadNewest();
    if (!loaded.ok()) return fault;
    note += ": took " + loaded->model.id;
  }
  loaded->note = note;
  return loaded;
}

Status Store::Check(const StoredModel& model) const {
  const Result<ModelOfStore> loaded = LoadModel(model.id, &model.hash);
  return loaded.ok() ? Status() : loaded.status();
}

Status Store::CountStart(const StoredModel& model) {
  return Update([&](StoreState& state) -> Result<bool> {
    if (state.confirmed || !(state.current == model)) return false;
    ++state.starts;
    return true;
  });
}

Status Store::Confirm(const StoredModel& model) {
  return Update([&](StoreState& state) -> Result<bool> {
    if (state.confirmed || !(state.current == model)) return false;
    state.confirmed = true;
    state.starts = 0;
    return true;
  });
}

Result<StoredModel> Store::Rollback() {
  StoredModel back;
  const Status status = Update([&](StoreState& state) -> Result<bool> {
    if (state.previous.empty()) return Status(StatusCode::kNotFound, "no model to go back to");
    state.rejected = state.current.id;
    std::swap(state.current, state.previous);
    state.confirmed = true;  // it was, before the other came
    state.starts = 0;
    back = state.current;
    return true;
  });
  if (!status.ok()) return status;
  return back;
}

Result<std::vector<std::string>> Store::Models() const {
  std::vector<std::string> names;
  if (files_.List(names) != 0) return FileFault("cannot list", ".");
  std::vector<std::string> ids;
  for (const std::string& name : names) {
    if (name.size() == 16 + kModelSuffix.size() && name.ends_with(kModelSuffix)) {
      ids.push_back(name.substr(0, 16));
    }
  }
  std::sort(ids.begin(), ids.end());
  return ids;
}

Status Store::RemoveModels(int keep, const StoreState& state, int& removed) {
  std::set<std::string> needed = {state.current.id, state.previous.id};
  // What the older pointer leads to, should the newer one be lost.
  for (const int which : {0, 1}) {
    if (const Result<StoreState> pointer = ReadPointer(which); pointer.ok()) {
      needed.insert(pointer->current.id);
    }
  }
  needed.erase("");
  const Result<std::vector<std::string>> ids = Models();
  if (!ids.ok()) return ids.status();
  int left = static_cast<int>(ids->size());
  for (const std::string& id : *ids) {
    if (left <= keep || needed.contains(id)) continue;
    if (files_.Unlink(ModelFile(id)) != 0) return FileFault("cannot remove", ModelFile(id));
    files_.Unlink(SignatureFile(id));
    --left;
    ++removed;
  }
  return {};
}

Result<int> Store::Gc(int keep) {
  const StoreLock lock(files_);
  if (!lock.status().ok()) return lock.status();
  const Result<StoreState> state = State();
  if (!state.ok()) return state.status();
  int removed = 0;
  if (Status status = RemoveModels(keep, *state, removed); !status.ok()) return status;
  std::vector<std::string> names;
  if (files_.List(names) != 0) return FileFault("cannot list", ".");
  for (const std::string& name : names) {
    const bool is_model_signature =
        name.ends_with(kSignatureSuffix) &&
        std::find(names.begin(), names.end(),
                  name.substr(0, name.size() - kSignatureSuffix.size()) +
                      std::string(kModelSuffix)) == names.end();
    const bool is_left_over =
        name.starts_with(kPartPrefix) || name.starts_with(kTemporaryPrefix) || is_model_signature;
    if (is_left_over && files_.Unlink(name) == 0) ++removed;
  }
  return removed;
}

}  // namespace viewfix
