// SPDX-License-Identifier: BSD-3-Clause
#include "platform/store/store_session.h"

#include <cstdio>
#include <utility>

namespace viewfix {
namespace {

class WatchedSource : public FrameSource {
 public:
  WatchedSource(FrameSource& source, StoreSession& session) : source_(source), session_(session) {}

  Status Next(Frame& frame) override {
    // To be asked for the next frame is to have got through the last.
    if (std::exchange(given_, false)) Tell(session_.FrameProcessed());
    if (session_.Changed()) return {StatusCode::kNotFound, "another model has come"};
    Status status = source_.Next(frame);
    given_ = status.ok();
    if (given_) Tell(session_.FrameReceived());
    return status;
  }

 private:
  void Tell(const Status& status) {
    if (status.ok() || std::exchange(told_, true)) return;
    std::fprintf(stderr, "viewfixd: store: %s: %.*s\n", status.text(),
                 static_cast<int>(status.detail().size()), status.detail().data());
  }

  FrameSource& source_;
  StoreSession& session_;
  bool given_ = false;
  bool told_ = false;
};

}  // namespace

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
  Result<LoadedModel> loaded = store_.Load();
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

std::unique_ptr<FrameSource> WatchFrames(FrameSource& source, StoreSession& session) {
  return std::make_unique<WatchedSource>(source, session);
}

}  // namespace viewfix
