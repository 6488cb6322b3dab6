// SPDX-License-Identifier: BSD-3-Clause
#include "platform/daemon/model_holder.h"

#include <sys/stat.h>

#include <utility>

#include "platform/camera/calibration.h"
#include "platform/clock.h"
#include "platform/file.h"

namespace viewfix {
namespace {

Status LoadInto(const ModelSettings& settings, LoadedModel& model) {
  Result<std::vector<std::uint8_t>> bytes = ReadFile(settings.model_path);
  if (!bytes.ok()) return bytes.status();
  model.bytes = std::move(*bytes);
  const Result<ModelView> view = ModelView::Open(model.bytes);
  if (!view.ok()) return AboutFile(settings.model_path, view.status());
  model.view = *view;
  Result<Localizer> localizer =
      Localizer::Create(model.view, {.now_ns = MonotonicNs, .window = settings.window});
  if (!localizer.ok()) return AboutFile(settings.model_path, localizer.status());
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

}  // namespace

ModelHolder::Stamp ModelHolder::StampOf(const std::string& path) {
  struct stat info = {};
  if (::stat(path.c_str(), &info) != 0) return {};
  return {static_cast<std::int64_t>(info.st_dev), static_cast<std::int64_t>(info.st_ino),
          static_cast<std::int64_t>(info.st_size), static_cast<std::int64_t>(info.st_mtim.tv_sec),
          static_cast<std::int64_t>(info.st_mtim.tv_nsec)};
}

Status ModelHolder::Load(const ModelSettings& settings) {
  path_ = settings.model_path;
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
  const Stamp now = StampOf(path_);
  const bool settled = now == std::exchange(seen_, now);
  return settled && now != tried_ && now != Stamp{};
}

}  // namespace viewfix
