// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "engine/fix_filter.h"
#include "engine/localizer.h"
#include "models/model_view.h"
#include "platform/publish/fix_writer.h"
#include "platform/store/store_session.h"

namespace viewfix {

// What a model is loaded with.
struct ModelSettings {
  std::string model_path = {};
  std::string store_folder = {};  // in place of model_path
  std::string trust_folder = {};
  std::string calibration_path = {};  // empty: the model's own camera
  int rotate_deg = 0;
  int window = 0;
  bool filter = true;
};

// A model and what works on it. Parts point to each other: it never moves. `view` may be read
// by any thread, the other parts belong to the one that localizes.
struct LoadedModel {
  std::vector<std::uint8_t> bytes;
  ModelView view;
  std::optional<Localizer> localizer;
  std::optional<FixWriter> writer;
  std::optional<FixFilter> filter;  // none: each frame is judged alone
  std::optional<Camera> camera;     // none: the model's own
  int rotate_deg = 0;
};

// The model in use. Load() reads and checks another one beside it and swaps them only when it is
// good: whoever works on the old one ends in peace. Thread-safe.
class ModelHolder {
 public:
  // The old model stays in use where this fails.
  Status Load(const ModelSettings& settings);
  // Null: none was ever loaded.
  std::shared_ptr<LoadedModel> Current() const;
  // Whether the file, or what its links lead to, is another than the one last tried, and has been
  // the same for two calls: it is not being written any more. Call it now and then.
  // Of a store: whether its pointer names another model.
  bool FileChanged();

  // For a model on trial in a store: the first frame counts the start, the hundredth processed one
  // confirms it. A store that cannot be written is told of once. Of the thread that localizes.
  void FrameReceived();
  void FrameProcessed();

 private:
  // Of a file: device, inode, size, time of change. Zeros: there is none.
  using Stamp = std::array<std::int64_t, 5>;
  static Stamp StampOf(const std::string& path);

  mutable std::mutex mutex_;
  std::shared_ptr<LoadedModel> current_;
  Status LoadInto(const ModelSettings& settings, LoadedModel& model);
  Result<std::vector<std::uint8_t>> ReadBytes(const ModelSettings& settings);
  Result<std::vector<std::uint8_t>> ReadFromStore(const ModelSettings& settings);
  void TellStore(Status (StoreSession::*what)());

  std::mutex session_mutex_;
  std::unique_ptr<StoreSession> session_;  // null: a file, or the store has no model yet
  std::string session_folder_;
  bool told_of_store_ = false;
  // Of the thread that loads alone.
  std::string path_;  // the file, or the store's first pointer
  Stamp tried_ = {};
  Stamp seen_ = {};
};

}  // namespace viewfix
