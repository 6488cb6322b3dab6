// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <mutex>
#include <string>

#include "engine/localizer.h"
#include "platform/camera/frame_source.h"
#include "platform/publish/publish_counts.h"

namespace viewfix {

// How the daemon is: what its threads report, and what watchdog, STATUS=, /health and /metrics
// say. Thread-safe.
class Health {
 public:
  enum Worker { kCapture, kLocalize, kServer, kWorkers };

  // A turn of a worker's loop, time-outs included.
  void Beat(Worker worker);
  // A worker that has ended is not waited for.
  void Retire(Worker worker);
  // Around Localize(): a frame that stays in it for longer than 2 s is a fault.
  void BeginFrame();
  void EndFrame();
  // Empty: every worker turns; else which does not, for the watchdog to be starved.
  std::string Stuck(std::int64_t now_ns) const;

  void SetCamera(const CameraCondition& condition, const CameraCounts& counts);
  CameraCondition camera() const;
  // `fault`: why the last load failed; empty: it did not.
  void SetModel(const std::string& short_hash, const std::string& fault);
  std::string model() const;  // its hash; empty: none
  std::string model_fault() const;

  void CountFix(const Fix& fix);
  void CountFailed() { ++failed_; }
  void CountIdle() { ++idle_; }
  void SetReplaced(std::uint64_t replaced) { replaced_ = replaced; }
  void SetIdle(bool idle) { idle_now_ = idle; }
  std::uint64_t frames() const { return frames_; }
  std::uint64_t localized() const { return localized_; }
  std::uint64_t failed() const { return failed_; }

  // "ok", "no_camera", "no_model" or "stuck".
  std::string State() const;
  // One line for systemctl status.
  std::string StatusLine() const;
  // A JSON object, and Prometheus' text format.
  std::string Json(const PublishCounts& published) const;
  std::string Metrics(const PublishCounts& published) const;

 private:
  double FramesPerSecond() const;

  std::array<std::atomic<std::int64_t>, kWorkers> beat_ns_ = {};  // 0: not to be waited for
  std::atomic<std::int64_t> frame_began_ns_ = 0;                  // 0: none is being localized
  std::atomic<std::uint64_t> frames_ = 0, localized_ = 0, failed_ = 0, idle_ = 0, replaced_ = 0;
  std::atomic<bool> idle_now_ = false;
  const std::int64_t started_ns_ = Now();
  static std::int64_t Now();

  mutable std::mutex mutex_;
  CameraCondition camera_ = {false, "not opened yet"};
  CameraCounts counts_;
  std::string model_, model_fault_;
  StageTimes last_ms_ = {};
  std::array<std::int64_t, 32> fix_ns_ = {};  // when the last frames were answered
  std::array<double, 5> ms_sum_ = {};         // features score verify pose total
};

}  // namespace viewfix
