// SPDX-License-Identifier: BSD-3-Clause
#include <unistd.h>

#include <cinttypes>
#include <csignal>
#include <cstdio>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "engine/fix_filter.h"
#include "engine/localizer.h"
#include "models/model_view.h"
#include "platform/camera/calibration.h"
#include "platform/camera/frame_source.h"
#include "platform/clock.h"
#include "platform/daemon/options.h"
#include "platform/daemon/run_loop.h"
#include "platform/file.h"
#include "platform/publish/fix_writer.h"
#include "platform/publish/publisher.h"
#include "platform/store/store_command.h"
#include "platform/store/store_session.h"

namespace viewfix {
namespace {

volatile std::sig_atomic_t g_stop = 0;

void OnStopSignal(int) { g_stop = 1; }

// No SA_RESTART: a signal must end a write that waits for its reader.
void HandleSignals() {
  struct sigaction stop = {};
  stop.sa_handler = OnStopSignal;
  sigaction(SIGINT, &stop, nullptr);
  sigaction(SIGTERM, &stop, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
}

int Fail(const Status& status) {
  PrintFault(status);
  return 1;
}

// Frames through one model, until they or the model end. kCancelled: the reader of the output has
// gone, or a signal came.
Status RunModel(const DaemonOptions& options, const std::string& name,
                const std::vector<std::uint8_t>& bytes, const Camera* camera, FrameSource& source,
                RunReport& report) {
  const Result<ModelView> model = ModelView::Open(bytes);
  if (!model.ok()) return AboutFile(name, model.status());
  Result<Localizer> localizer =
      Localizer::Create(*model, {.now_ns = MonotonicNs, .window = options.window});
  if (!localizer.ok()) return AboutFile(name, localizer.status());
  FixWriter writer(*model);
  const std::unique_ptr<Publisher> publisher = MakeStreamPublisher(STDOUT_FILENO);
  FixFilter filter(*model);
  return RunLoop(source, options.rotate_deg, camera, *localizer, options.filter ? &filter : nullptr,
                 writer, *publisher, g_stop, report);
}

Status RunStore(const DaemonOptions& options, const Camera* camera, FrameSource& source,
                RunReport& report) {
  const auto session = StoreSession::Start(options.store_folder, options.trust_folder);
  if (!session.ok()) return AboutFile(options.store_folder, session.status());
  StoreSession& store = **session;
  const std::unique_ptr<FrameSource> watched = WatchFrames(source, store);
  while (true) {
    if (!store.model().note.empty()) {
      std::fprintf(stderr, "viewfixd: store: %s\n", store.model().note.c_str());
    }
    const Status status =
        RunModel(options, store.model().model.id, store.model().bytes, camera, *watched, report);
    if (!status.ok() || g_stop != 0 || !store.Changed()) return status;
    if (const Status reload = store.Reload(); !reload.ok()) PrintFault(reload);
  }
}

int Run(const DaemonOptions& options) {
  HandleSignals();
  std::vector<std::uint8_t> bytes;
  if (options.store_folder.empty()) {
    Result<std::vector<std::uint8_t>> read = ReadFile(options.model_path);
    if (!read.ok()) return Fail(read.status());
    bytes = std::move(*read);
    // Said before the camera is asked for: a model that cannot be used comes first.
    const Result<ModelView> model = ModelView::Open(bytes);
    if (!model.ok()) return Fail(AboutFile(options.model_path, model.status()));
  }
  Camera camera;
  if (!options.calibration_path.empty()) {
    const Result<Camera> read = ReadCalibration(options.calibration_path);
    if (!read.ok()) return Fail(read.status());
    camera = *read;
  }
  const Result<std::unique_ptr<FrameSource>> source = OpenReplay(options.replay_folder);
  if (!source.ok()) return Fail(source.status());

  const Camera* const given = options.calibration_path.empty() ? nullptr : &camera;
  RunReport report;
  const Status status = options.store_folder.empty()
                            ? RunModel(options, options.model_path, bytes, given, **source, report)
                            : RunStore(options, given, **source, report);
  if (status.code() == StatusCode::kCancelled && g_stop == 0) return 0;  // as in `| head`
  if (!status.ok() && g_stop == 0) return Fail(status);
  std::fprintf(stderr,
               "viewfixd: %" PRIu64 " frames, %" PRIu64 " localized, %" PRIu64 " unusable\n",
               report.frames, report.localized, report.failed);
  if (report.frames > 0 || report.failed == 0) return 0;
  return Fail({StatusCode::kCorrupt, "no frame could be used", options.replay_folder});
}

int Main(int argc, char** argv) {
  if (argc > 1 && std::string_view(argv[1]) == "store") return RunStoreCommand(argc - 1, argv + 1);
  const DaemonOptions options = ParseDaemonOptions(argc, argv);
  switch (options.action) {
    case DaemonOptions::Action::kHelp:
      std::fputs(DaemonHelp(), stdout);
      return 0;
    case DaemonOptions::Action::kVersion:
      std::puts("viewfixd " VIEWFIX_VERSION);
      return 0;
    case DaemonOptions::Action::kWrongUsage:
      std::fprintf(stderr, "viewfixd: %s (see viewfixd --help)\n", options.error.c_str());
      return 2;
    case DaemonOptions::Action::kRun:
      return Run(options);
  }
  return 2;
}

}  // namespace
}  // namespace viewfix

int main(int argc, char** argv) { return viewfix::Main(argc, argv); }
