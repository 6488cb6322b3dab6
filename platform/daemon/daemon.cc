// SPDX-License-Identifier: BSD-3-Clause
#include "platform/daemon/daemon.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <atomic>
#include <cinttypes>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "platform/clock.h"
#include "platform/daemon/health.h"
#include "platform/daemon/model_holder.h"
#include "platform/daemon/notify.h"
#include "platform/daemon/pipeline.h"
#include "platform/daemon/signals.h"
#include "platform/log.h"
#include "platform/publish/mqtt_output.h"
#include "platform/publish/server.h"

namespace viewfix {
namespace {

constexpr int kTurnMs = 500;  // of the loop that looks after all others
// At the end: longer than most frames take, shorter than those who stop us wait.
constexpr int kLastFrameMs = 100;

ModelSettings ModelSettingsOf(const DaemonOptions& options) {
  return {options.model_path, options.store_folder, options.trust_folder, options.calibration_path,
          options.rotate_deg, options.window,       options.filter};
}

class Daemon {
 public:
  Daemon(const CommandLine& command_line, const DaemonOptions& options)
      : command_line_(command_line), options_(options) {}
  ~Daemon();

  int Run();

 private:
  Status LoadModel();
  Status OpenPublishers();
  ServerContent ServedContent();
  Status StartPipeline();
  void Watch();
  void Turn();
  bool OnSignals();
  void Reload();
  int ExitCode() const;

  const CommandLine& command_line_;
  DaemonOptions options_;
  Signals signals_;  // the last to go
  Notifier notifier_;
  Health health_;
  ModelHolder models_;
  std::unique_ptr<Publisher> publisher_;
  Server* server_ = nullptr;                 // publisher_'s; null: none
  std::atomic<MqttOutput*> mqtt_ = nullptr;  // the same; read by the server's thread
  std::unique_ptr<Pipeline> pipeline_;
  int ended_ = -1;  // an eventfd: the pipeline has ended
  bool live_ = false;
  bool stopped_by_signal_ = false;
  std::string last_stuck_;
  std::string last_status_;
};

Daemon::~Daemon() {
  pipeline_.reset();
  if (ended_ >= 0) ::close(ended_);
}

Status Daemon::LoadModel() {
  const Status status = models_.Load(ModelSettingsOf(options_));
  const std::shared_ptr<LoadedModel> model = models_.Current();
  std::string hash, fault;
  if (model != nullptr) {
    const auto digits = model->view.short_hash();
    hash.assign(digits.begin(), digits.end());
  }
  if (!status.ok()) fault.append(status.text()).append(": ").append(status.detail());
  health_.SetModel(hash, fault);
  return status;
}

Status Daemon::OpenPublishers() {
  std::vector<std::unique_ptr<Publisher>> outputs;
  const PublishSettings& settings = options_.publish;
  if (!settings.unix_path.empty() || settings.http_port != 0) {
    Result<std::unique_ptr<Server>> server = Server::Start(settings, ServedContent());
    if (!server.ok()) return server.status();
    server_ = server->get();
    outputs.push_back(std::move(*server));
  }
  if (!settings.mqtt_url.empty()) {
    Result<std::unique_ptr<MqttOutput>> mqtt = MakeMqttOutput(settings);
    if (!mqtt.ok()) return mqtt.status();
    mqtt_ = mqtt->get();
    outputs.push_back(std::move(*mqtt));
  }
  if (settings.to_stdout) {
    outputs.push_back(live_ ? MakeDroppingPublisher(STDOUT_FILENO)
                            : MakeStreamPublisher(STDOUT_FILENO, [this] {
                                health_.Beat(Health::kLocalize);
                                return !pipeline_->stopping();
                              }));
  }
  publisher_ = MakeFan(std::move(outputs));
  return {};
}

ServerContent Daemon::ServedContent() {
  const auto with_mqtt = [this](PublishCounts counts) {
    if (const MqttOutput* mqtt = mqtt_; mqtt != nullptr) counts.dropped_lines += mqtt->dropped();
    return counts;
  };
  return {[=, this](const PublishCounts& counts) { return health_.Json(with_mqtt(counts)); },
          [=, this](const PublishCounts& counts) { return health_.Metrics(with_mqtt(counts)); },
          [this] { return health_.State() == "ok"; },
          [this]() -> std::shared_ptr<const ModelView> {
            const std::shared_ptr<LoadedModel> model = models_.Current();
            if (model == nullptr) return nullptr;
            return {model, &model->view};
          },
          [this] { health_.Beat(Health::kServer); }};
}

Status Daemon::StartPipeline() {
  Result<std::unique_ptr<FrameSource>> source = OpenCamera(options_.camera);
  if (!source.ok()) return source.status();
  live_ = (*source)->live();
  // A model that is missing may come; files that stand in for a camera may as well wait for it.
  if (const Status status = LoadModel(); !status.ok()) {
    if (!live_) return status;
    PrintFault(status);
  }
  if (Status status = OpenPublishers(); !status.ok()) return status;
  std::function<void(const YuvImage&, std::span<const SeenPoint>)> show;
  if (server_ != nullptr && options_.publish.frame_picture) {
    show = [this](const YuvImage& frame, std::span<const SeenPoint> points) {
      server_->Show(frame, points);
    };
  }
  pipeline_ = std::make_unique<Pipeline>(
      std::move(*source), PipelineRates{options_.max_fps, options_.idle_fps},
      Pipeline::Parts{&models_, &health_, publisher_.get(), std::move(show)});
  pipeline_->Start([this] { (void)::eventfd_write(ended_, 1); });
  return {};
}

int Daemon::Run() {
  ended_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  if (!signals_.Start() || ended_ < 0) {
    LogLine(LogLevel::kError, "no descriptors for signals");
    return 1;
  }
  if (const Status status = StartPipeline(); !status.ok()) {
    PrintFault(status);
    return 1;
  }
  notifier_.Send("READY=1");
  Watch();
  notifier_.Send("STOPPING=1");
  pipeline_->BeginStop();
  pollfd ended = {ended_, POLLIN, 0};
  const bool in_time = ::poll(&ended, 1, kLastFrameMs) > 0;
  if (in_time) pipeline_->Stop();
  mqtt_ = nullptr;
  publisher_.reset();
  const int code = ExitCode();
  // A thread still works on what would be freed; nothing of it is to be kept.
  if (!in_time) std::_Exit(code);
  return code;
}

void Daemon::Watch() {
  const std::int64_t feed_ms = notifier_.watchdog_ns() / 3'000'000;
  const int turn_ms = feed_ms > 0 && feed_ms < kTurnMs ? static_cast<int>(feed_ms) : kTurnMs;
  pollfd waiting[] = {{signals_.fd(), POLLIN, 0}, {ended_, POLLIN, 0}};
  while (true) {
    (void)::poll(waiting, 2, turn_ms);
    if (waiting[1].revents != 0 || !OnSignals()) return;
    Turn();
  }
}

// False: it is time to end.
bool Daemon::OnSignals() {
  const bool reload = signals_.TakeReload();
  stopped_by_signal_ = signals_.ending();
  if (reload && !stopped_by_signal_) Reload();
  return !stopped_by_signal_;
}

void Daemon::Turn() {
  const std::string stuck = health_.Stuck(MonotonicNs());
  if (stuck.empty()) notifier_.Send("WATCHDOG=1");
  if (std::exchange(last_stuck_, stuck) != stuck && !stuck.empty()) {
    LogLine(LogLevel::kError, stuck);
  }
  if (std::string status = health_.StatusLine(); status != last_status_) {
    notifier_.Send("STATUS=" + status);
    last_status_ = std::move(status);
  }
  if (!models_.FileChanged()) return;
  if (const Status status = LoadModel(); !status.ok()) return PrintFault(status);
  LogLine(LogLevel::kInfo, "model " + health_.model() + " is in use");
}

// What fails leaves things as they were.
void Daemon::Reload() {
  notifier_.Send("RELOADING=1\nMONOTONIC_USEC=" + std::to_string(MonotonicNs() / 1000));
  DaemonOptions loaded;
  if (const std::string fault = LoadOptions(command_line_, loaded); !fault.empty()) {
    LogLine(LogLevel::kError, "not reloaded: " + fault);
  } else {
    if (loaded.publish != options_.publish) {
      LogLine(LogLevel::kWarning, "publish: changes take a restart");
      loaded.publish = options_.publish;
    }
    const bool other_camera = loaded.camera != options_.camera;
    options_ = std::move(loaded);
    if (const Status status = LoadModel(); !status.ok()) PrintFault(status);
    pipeline_->SetRates({options_.max_fps, options_.idle_fps});
    if (other_camera) {
      Result<std::unique_ptr<FrameSource>> source = OpenCamera(options_.camera);
      if (source.ok() && (*source)->live() == live_) {
        pipeline_->ReplaceSource(std::move(*source));
      } else {
        LogLine(LogLevel::kWarning, "camera: this change takes a restart");
      }
    }
    LogLine(LogLevel::kInfo, "configuration and model read again");
  }
  notifier_.Send("READY=1");
}

int Daemon::ExitCode() const {
  const Status fault = pipeline_->fault();
  if (!stopped_by_signal_ && fault.code() == StatusCode::kCancelled) return 0;  // as in `| head`
  if (!stopped_by_signal_ && !fault.ok()) {
    PrintFault(fault);
    return 1;
  }
  char line[128];
  std::snprintf(line, sizeof line,
                "%" PRIu64 " frames, %" PRIu64 " localized, %" PRIu64 " unusable", health_.frames(),
                health_.localized(), health_.failed());
  LogLine(LogLevel::kInfo, line);
  if (live_ || health_.frames() > 0 || health_.failed() == 0) return 0;
  PrintFault({StatusCode::kCorrupt, "no frame could be used", options_.camera.where});
  return 1;
}

}  // namespace

int RunDaemon(const CommandLine& command_line, const DaemonOptions& options) {
  return Daemon(command_line, options).Run();
}

}  // namespace viewfix
