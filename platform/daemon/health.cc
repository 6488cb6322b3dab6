// SPDX-License-Identifier: BSD-3-Clause
#include "platform/daemon/health.h"

#include <algorithm>
#include <cstdio>

#include "platform/clock.h"
#include "platform/publish/json_line.h"

namespace viewfix {
namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000;
constexpr std::int64_t kMaxFrameNs = 2 * kSecondNs;
constexpr std::int64_t kMaxTurnNs = 10 * kSecondNs;  // opening a USB camera takes seconds

constexpr const char* kWorkerNames[] = {"capture", "localize", "server"};
constexpr const char* kStageNames[] = {"features", "score", "verify", "pose", "total"};

void Append(std::string& text, const char* format, double value) {
  char buffer[64];
  std::snprintf(buffer, sizeof buffer, format, value);
  text.append(buffer);
}

// One number of Prometheus' text format with its two lines of comment.
void Metric(std::string& text, const char* name, const char* type, const char* help, double value) {
  text.append("# HELP viewfix_").append(name).append(" ").append(help);
  text.append("\n# TYPE viewfix_").append(name).append(" ").append(type);
  text.append("\nviewfix_").append(name);
  Append(text, " %.10g\n", value);
}

void Counter(std::string& text, const char* name, const char* help, std::uint64_t value) {
  Metric(text, name, "counter", help, static_cast<double>(value));
}

// Resident memory in bytes; 0: not told.
double ResidentBytes() {
  std::FILE* file = std::fopen("/proc/self/statm", "re");
  if (file == nullptr) return 0;
  long size = 0, resident = 0;
  const int read = std::fscanf(file, "%ld %ld", &size, &resident);
  std::fclose(file);
  return read == 2 ? static_cast<double>(resident) * 4096 : 0;
}

}  // namespace

std::int64_t Health::Now() { return MonotonicNs(); }

void Health::Beat(Worker worker) { beat_ns_[worker] = Now(); }
void Health::Retire(Worker worker) { beat_ns_[worker] = 0; }
void Health::BeginFrame() { frame_began_ns_ = Now(); }
void Health::EndFrame() { frame_began_ns_ = 0; }

std::string Health::Stuck(std::int64_t now_ns) const {
  const std::int64_t began_ns = frame_began_ns_;
  if (began_ns != 0 && now_ns - began_ns > kMaxFrameNs) return "a frame stays in Localize";
  for (int worker = 0; worker < kWorkers; ++worker) {
    const std::int64_t beat_ns = beat_ns_[worker];
    if (beat_ns != 0 && now_ns - beat_ns > kMaxTurnNs) {
      return std::string("thread ") + kWorkerNames[worker] + " does not turn";
    }
  }
  return {};
}

void Health::SetCamera(const CameraCondition& condition, const CameraCounts& counts) {
  const std::lock_guard lock(mutex_);
  camera_ = condition;
  counts_ = counts;
}

CameraCondition Health::camera() const {
  const std::lock_guard lock(mutex_);
  return camera_;
}

void Health::SetModel(const std::string& short_hash, const std::string& fault) {
  const std::lock_guard lock(mutex_);
  model_ = short_hash;
  model_fault_ = fault;
}

std::string Health::model() const {
  const std::lock_guard lock(mutex_);
  return model_;
}

std::string Health::model_fault() const {
  const std::lock_guard lock(mutex_);
  return model_fault_;
}

void Health::CountFix(const Fix& fix) {
  const std::lock_guard lock(mutex_);
  fix_ns_[static_cast<std::size_t>(frames_ % fix_ns_.size())] = Now();
  ++frames_;
  if (fix.localized) ++localized_;
  last_ms_ = fix.ms;
  const float ms[] = {fix.ms.features, fix.ms.score, fix.ms.verify, fix.ms.pose, fix.ms.total};
  for (std::size_t i = 0; i < ms_sum_.size(); ++i) ms_sum_[i] += ms[i];
}

// Over the last frames, and at most three seconds. Call with mutex_ held.
double Health::FramesPerSecond() const {
  const std::int64_t now_ns = Now(), since_ns = now_ns - 3 * kSecondNs;
  std::int64_t first_ns = now_ns;
  int count = 0;
  for (const std::int64_t at_ns : fix_ns_) {
    if (at_ns == 0 || at_ns < since_ns) continue;
    ++count;
    first_ns = std::min(first_ns, at_ns);
  }
  if (count < 2) return 0;
  return count / (static_cast<double>(std::max<std::int64_t>(now_ns - first_ns, 1)) * 1e-9);
}

std::string Health::State() const {
  if (!Stuck(Now()).empty()) return "stuck";
  const std::lock_guard lock(mutex_);
  if (model_.empty()) return "no_model";
  return camera_.present ? "ok" : "no_camera";
}

std::string Health::StatusLine() const {
  const std::string state = State();
  const std::lock_guard lock(mutex_);
  std::string line = state + "; camera: " + camera_.text + "; model: ";
  line.append(model_.empty() ? "none" : model_);
  if (!model_fault_.empty()) line.append(" (").append(model_fault_).append(")");
  Append(line, "; %.1f frames/s", FramesPerSecond());
  if (idle_now_) line.append(", nothing moves");
  return line;
}

std::string Health::Json(const PublishCounts& published) const {
  const std::string state = State(), stuck = Stuck(Now());
  JsonLine json;
  const auto count = [&](const char* key, std::uint64_t value) {
    json.Raw(key);
    json.Integer(static_cast<std::int64_t>(value));
  };
  const std::lock_guard lock(mutex_);
  json.Raw("{\"schema\":1,\"state\":");
  json.String(state);
  json.Raw(",\"stuck\":");
  json.String(stuck);
  count(",\"uptime_s\":", static_cast<std::uint64_t>((Now() - started_ns_) / kSecondNs));
  json.Raw(",\"camera\":{\"present\":");
  json.Raw(camera_.present ? "true" : "false");
  json.Raw(",\"text\":");
  json.String(camera_.text);
  count(",\"delivered\":", counts_.delivered);
  count(",\"skipped\":", counts_.skipped + replaced_);
  count(",\"lost\":", counts_.lost);
  count(",\"erroneous\":", counts_.erroneous);
  count(",\"truncated\":", counts_.truncated);
  count(",\"timeouts\":", counts_.timeouts);
  count(",\"reconnects\":", counts_.reconnects);
  json.Raw("},\"model\":{\"hash\":");
  model_.empty() ? json.Raw("null") : json.String(model_);
  json.Raw(",\"fault\":");
  model_fault_.empty() ? json.Raw("null") : json.String(model_fault_);
  json.Raw("},\"frames\":{");
  count("\"answered\":", frames_);
  count(",\"localized\":", localized_);
  count(",\"unusable\":", failed_);
  count(",\"still\":", idle_);
  json.Raw(",\"per_second\":");
  json.Float(static_cast<float>(FramesPerSecond()));
  json.Raw("},\"idle\":");
  json.Raw(idle_now_ ? "true" : "false");
  json.Raw(",\"outputs\":{");
  count("\"lines\":", published.lines);
  count(",\"clients\":", published.clients);
  count(",\"dropped_lines\":", published.dropped_lines);
  count(",\"dropped_clients\":", published.dropped_clients);
  json.Raw("},\"last_ms\":");
  json.Float(last_ms_.total);
  json.Raw("}\n");
  return std::string(json.text());
}

std::string Health::Metrics(const PublishCounts& published) const {
  const bool ok = State() == "ok";
  const std::lock_guard lock(mutex_);
  std::string text;
  Metric(text, "up", "gauge", "1: camera, model and threads are well", ok ? 1 : 0);
  Metric(text, "camera_present", "gauge", "1: the camera is there", camera_.present ? 1 : 0);
  Metric(text, "model_loaded", "gauge", "1: there is a model", model_.empty() ? 0 : 1);
  Metric(text, "idle", "gauge", "1: nothing moves in the picture", idle_now_ ? 1 : 0);
  Metric(text, "frames_per_second", "gauge", "frames answered", FramesPerSecond());
  Metric(text, "resident_bytes", "gauge", "memory in use", ResidentBytes());
  Metric(text, "uptime_seconds", "counter", "since the start",
         static_cast<double>(Now() - started_ns_) * 1e-9);
  Counter(text, "frames_total", "frames answered", frames_);
  Counter(text, "frames_localized_total", "frames localized", localized_);
  Counter(text, "frames_unusable_total", "frames that could not be used", failed_);
  Counter(text, "frames_still_total", "frames passed over because nothing moved", idle_);
  Counter(text, "camera_frames_total", "frames that the camera delivered", counts_.delivered);
  Counter(text, "camera_skipped_total", "frames older than the newest",
          counts_.skipped + replaced_);
  Counter(text, "camera_lost_total", "frames missing in the driver's count", counts_.lost);
  Counter(text, "camera_erroneous_total", "buffers flagged as damaged", counts_.erroneous);
  Counter(text, "camera_truncated_total", "frames with missing bytes", counts_.truncated);
  Counter(text, "camera_timeouts_total", "waits without a frame", counts_.timeouts);
  Counter(text, "camera_reconnects_total", "times the camera was opened again", counts_.reconnects);
  Counter(text, "lines_total", "lines published", published.lines);
  Counter(text, "lines_dropped_total", "lines that slow readers missed", published.dropped_lines);
  Counter(text, "clients_dropped_total", "readers dropped", published.dropped_clients);
  Metric(text, "clients", "gauge", "readers connected", static_cast<double>(published.clients));
  text.append("# HELP viewfix_stage_ms_total milliseconds by stage\n");
  text.append("# TYPE viewfix_stage_ms_total counter\n");
  for (std::size_t i = 0; i < ms_sum_.size(); ++i) {
    text.append("viewfix_stage_ms_total{stage=\"").append(kStageNames[i]).append("\"}");
    Append(text, " %.10g\n", ms_sum_[i]);
  }
  return text;
}

}  // namespace viewfix
