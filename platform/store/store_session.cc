// SPDX-License-Identifier: BSD-3-Clause
#include "platform/store/store_session.h"

#include <utility>

namespace viewfix {
Result<std::unique_ptr<StoreSession>> StoreSession::Start(const std::string& store_folder,
                                                          const std::string& trust_folder) {
  Result<Trust> trust = ReadTrust(trust_folder);
  if (!trust.ok()) return trust.status();
  auto files = OpenFolder(store_folder, false);
  if (!files.ok()) return files.status();
  FileOps& borrowed = **files;
  std::unique_ptr<StoreSession> session(
      new StoreSession(std::move(*files), borrowed, std::move(*trust), trust_folder));
  if (Status status = session->Take(); !status.ok()) return status;
  return session;
}

Result<std::unique_ptr<StoreSession>> StoreSession::Start(FileOps& files, Trust trust) {
  std::unique_ptr<StoreSession> session(new StoreSession(nullptr, files, std::move(trust), ""));
  if (Status status = session->Take(); !status.ok()) return status;
  return session;
}

Status StoreSession::Take() {
  Result<ModelOfStore> loaded = store_.Load();
  if (!loaded.ok()) return loaded.status();
  model_ = std::move(*loaded);
  const Result<StoreState> state = store_.State();
  pointed_ = state.ok() ? state->current : StoredModel();
  confirmed_ = state.ok() && state->confirmed;
  counted_ = confirmed_;
  processed_ = 0;
  return {};
}

Status StoreSession::FrameReceived() {
  if (std::exchange(counted_, true)) return {};
  return store_.CountStart(model_.model);
}

Status StoreSession::FrameProcessed() {
  if (confirmed_ || ++processed_ < kFramesToConfirm) return {};
  confirmed_ = true;
  return store_.Confirm(model_.model);
}

bool StoreSession::Changed() const {
  const Result<StoreState> state = store_.State();
  return state.ok() && !(state->current == pointed_);
}

Status StoreSession::Reload() {
  if (!trust_folder_.empty()) {
    Result<Trust> trust = ReadTrust(trust_folder_);
    if (!trust.ok()) return trust.status();
    trust_ = std::move(*trust);
  }
  const Status status = Take();
  // Not asked again and again for a model that cannot be had.
  if (!status.ok()) {
    if (const Result<StoreState> state = store_.State(); state.ok()) pointed_ = state->current;
  }
  return status;
}

}  // namespace viewfix
