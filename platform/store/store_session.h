// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "platform/store/store.h"

namespace viewfix {

// The daemon's part in the store: which model to start from, whether it proves itself, and whether
// another has come. A camera without frames neither confirms a model nor rolls it back.
class StoreSession {
 public:
  // Frames processed without a crash, localized or not, that confirm a model on trial.
  static constexpr int kFramesToConfirm = 100;

  // Takes the model to start from, rolling back if need be. kNotFound: the store has none.
  static Result<std::unique_ptr<StoreSession>> Start(const std::string& store_folder,
                                                     const std::string& trust_folder);
  // The same with other file operations, which are borrowed (tests).
  static Result<std::unique_ptr<StoreSession>> Start(FileOps& files, Trust trust);

  const ModelOfStore& model() const { return model_; }

  // Before a frame is processed: the first one counts the start, on disk.
  Status FrameReceived();
  // After it: the hundredth confirms the model.
  Status FrameProcessed();

  // Whether the pointer names another model than at the last Start() or Reload(). Cheap enough to
  // ask before every frame; a store that cannot be read has not changed.
  bool Changed() const;
  // Takes the new model, and its keys as they are trusted now; the old one stays where that fails.
  Status Reload();

 private:
  StoreSession(std::unique_ptr<FileOps> own_files, FileOps& files, Trust trust,
               std::string trust_folder)
      : own_files_(std::move(own_files)),
        files_(files),
        trust_(std::move(trust)),
        trust_folder_(std::move(trust_folder)),
        store_(files_, trust_) {}
  Status Take();

  std::unique_ptr<FileOps> own_files_;
  FileOps& files_;
  Trust trust_;
  std::string trust_folder_;  // empty: trust_ stays
  Store store_;
  ModelOfStore model_;
  StoredModel pointed_;  // what the pointer named then
  int processed_ = 0;
  bool counted_ = false;
  bool confirmed_ = false;
};

}  // namespace viewfix
