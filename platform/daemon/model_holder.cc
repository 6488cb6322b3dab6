// SPDX-License-Identifier: BSD-3-Clause
#include "platform/daemon/model_holder.h"

#include <sys/stat.h>

#include <utility>

#include "platform/camera/calibration.h"
#include "platform/clock.h"
#include "platform/file.h"
#include "platform/log.h"

namespace viewfix {
namespace {

// Of a store, the file whose coming says that there is a model now.
std::string WatchedPath(const ModelSettings& settings) {
  return settings.store_folder.empty() ? settings.model_path : settings.store_folder + "/pointer-0";
}

const std::string& NameOf(const ModelSettings& settings) {
  return settings.store_folder.empty() ? settings.model_path : settings.store_folder;
}

}  // namespace

Result<std::vector<std::uint8_t>> ModelHolder::ReadFromStore(const ModelSettings& settings) {
  const std::lock_guard lock(session_mutex_);
  if (session_ == nullptr || session_folder_ != settings.store_folder) {
    auto session = StoreSession::Start(settings.store_folder, settings.trust_folder);
    if (!session.ok()) return AboutFile(settings.store_folder, session.status());
    session_ = std::move(*session);
    session_folder_ = settings.store_folder;
  } else if (session_->Changed()) {
    if (Status status = session_->Reload(); !status.ok()) {
      return AboutFile(settings.store_folder, status);
    }
  }
  if (const std::string& note = session_->model().note; !note.empty()) {
    LogLine(LogLevel::kWarning, "store: " + note);
  }
  return session_->model().bytes;
}

Result<std::vector<std::uint8_t>> ModelHolder::ReadBytes(const ModelSettings& settings) {
  if (!settings.store_folder.empty()) return ReadFromStore(settings);
  const std::lock_guard lock(session_mutex_);
  session_.reset();
  return ReadFile(settings.model_path);
}

Status ModelHolder::LoadInto(const ModelSettings& settings, LoadedModel& model) {
  Result<std::vector<std::uint8_t>> bytes = ReadBytes(settings);
  if (!bytes.ok()) return bytes.status();
  model.bytes = std::move(*bytes);
  const Result<ModelView> view = ModelView::Open(model.bytes);
  if (!view.ok()) return AboutFile(NameOf(settings), view.status());
  model.view = *view;
  Result<Localizer> localizer =
      Localizer::Create(model.view, {.now_ns = MonotonicNs, .window = settings.window});
  if (!localizer.ok()) return AboutFile(NameOf(settings), localizer.status());
  model.localizer.emplace(std::move(*localizer));
  model.writer.emplace(model.view);
  if (settings.filter) model.filter.emplace(model.view);
  model.rotate_deg = settings.rotate_deg;
  if (settings.calibration_path.empty()) return {};
  const Result<Camera> camera = ReadCalibration(settings.calibration_path);
  if (!camera.ok()) return camera.status();
  model.camera = *camera;
  return {};
}

void ModelHolder::TellStore(Status (StoreSession::*what)()) {
  const std::lock_guard lock(session_mutex_);
  if (session_ == nullptr) return;
  const Status status = ((*session_).*what)();
  if (status.ok() || std::exchange(told_of_store_, true)) return;
  PrintFault(status);
}

void ModelHolder::FrameReceived() { TellStore(&StoreSession::FrameReceived); }
void ModelHolder::FrameProcessed() { TellStore(&StoreSession::FrameProcessed); }

ModelHolder::Stamp ModelHolder::StampOf(const std::string& path) {
  struct stat info = {};
  if (::stat(path.c_str(), &info) != 0) return {};
  return {static_cast<std::int64_t>(info.st_dev), static_cast<std::int64_t>(info.st_ino),
          static_cast<std::int64_t>(info.st_size), static_cast<std::int64_t>(info.st_mtim.tv_sec),
          static_cast<std::int64_t>(info.st_mtim.tv_nsec)};
}

Status ModelHolder::Load(const ModelSettings& settings) {
  path_ = WatchedPath(settings);
  tried_ = seen_ = StampOf(path_);  // before reading: what is written meanwhile counts as new
  auto model = std::make_shared<LoadedModel>();
  if (Status status = LoadInto(settings, *model); !status.ok()) return status;
  const std::lock_guard lock(mutex_);
  current_ = std::move(model);
  return {};
}

std::shared_ptr<LoadedModel> ModelHolder::Current() const {
  const std::lock_guard lock(mutex_);
  return current_;
}

bool ModelHolder::FileChanged() {
  {
    const std::lock_guard lock(session_mutex_);
    if (session_ != nullptr) return session_->Changed();
  }
  const Stamp now = StampOf(path_);
  const bool settled = now == std::exchange(seen_, now);
  return settled && now != tried_ && now != Stamp{};
}

}  // namespace viewfix
