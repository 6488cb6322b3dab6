// SPDX-License-Identifier: BSD-3-Clause
#include "platform/daemon/pipeline.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "platform/clock.h"
#include "platform/publish/state_line.h"

namespace viewfix {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;

constexpr std::int64_t kSecondNs = 1'000'000'000;
constexpr std::int64_t kNominalNs = kSecondNs / 10;
constexpr std::int64_t kForgetAfter = 1000;
constexpr milliseconds kPatience{250};
// A scene that was still for so long is looked at less often.
constexpr std::int64_t kIdleAfterNs = 2 * kSecondNs;
// While idle, so often is looked whether something moves.
constexpr std::int64_t kIdleLookNs = kSecondNs / 5;

FeatureType TypeOf(const LoadedModel& model) {
  return static_cast<FeatureType>(model.view.features().type);
}

}  // namespace

Pipeline::Pipeline(std::unique_ptr<FrameSource> source, const PipelineRates& rates, Parts parts)
    : parts_(std::move(parts)),
      live_(source->live()),
      log_(live_),
      mailbox_(!live_),
      source_(std::move(source)) {
  SetRates(rates);
}

Pipeline::~Pipeline() { Stop(); }

void Pipeline::Start(std::function<void()> on_end) {
  on_end_ = std::move(on_end);
  parts_.health->Beat(Health::kCapture);
  parts_.health->Beat(Health::kLocalize);
  capture_thread_ = std::thread([this] { Capture(); });
  localize_thread_ = std::thread([this] { LocalizeFrames(); });
}

void Pipeline::BeginStop() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
    source_->Wake();
    wake_.notify_all();
  }
  mailbox_.Close();
  const std::lock_guard publishing(publish_mutex_);
}

void Pipeline::Stop() {
  BeginStop();
  if (capture_thread_.joinable()) capture_thread_.join();
  if (localize_thread_.joinable()) localize_thread_.join();
}

std::int64_t Pipeline::IntervalNs(double fps) const {
  return fps > 0 ? static_cast<std::int64_t>(1e9 / fps) : 0;
}

void Pipeline::SetRates(const PipelineRates& rates) {
  const std::lock_guard lock(mutex_);
  rates_ = rates;
  wanted_interval_ns_ = 0;
}

void Pipeline::ReplaceSource(std::unique_ptr<FrameSource> source) {
  const std::lock_guard lock(mutex_);
  next_source_ = std::move(source);
  source_->Wake();
}

void Pipeline::Capture() {
  Frame frame;
  while (!stop_ && !ended_ && localizing_) {
    parts_.health->Beat(Health::kCapture);
    AdoptSource();
    CaptureOne(frame);
  }
  mailbox_.Close();
  parts_.health->Retire(Health::kCapture);
}

void Pipeline::AdoptSource() {
  std::unique_ptr<FrameSource> old;  // closed outside of the lock
  const std::lock_guard lock(mutex_);
  if (next_source_ == nullptr) return;
  old = std::exchange(source_, std::move(next_source_));
  sequence_base_ = next_sequence_;
}

void Pipeline::CaptureOne(Frame& frame) {
  source_->SetMinInterval(wanted_interval_ns_);
  frame.image.luma_only = LumaIsEnough();
  const Status status = source_->Next(frame);
  if (live_) {
    const CameraCondition condition = source_->condition();
    parts_.health->SetCamera(condition, source_->counts());
    if (std::exchange(last_condition_, condition.text) != condition.text) {
      log_.Write(condition.present ? LogLevel::kInfo : LogLevel::kWarning,
                 "camera: " + condition.text);
    }
  }
  if (status.ok()) return Hand(frame);
  if (status.code() == StatusCode::kCancelled) return;
  if (status.code() == StatusCode::kNotFound) {
    ended_ = true;
    return;
  }
  log_.Write(status);
  parts_.health->CountFailed();
}

bool Pipeline::LumaIsEnough() const {
  const std::shared_ptr<LoadedModel> model = parts_.models->Current();
  return model != nullptr && !SeesColours(TypeOf(*model));
}

void Pipeline::Hand(Frame& frame) {
  frame.sequence += sequence_base_;
  next_sequence_ = frame.sequence + 1;
  if (!live_) parts_.health->SetCamera({true, "replay"}, {.delivered = next_sequence_});
  while (!stop_ && localizing_ && !mailbox_.Put(frame, kPatience)) {
    parts_.health->Beat(Health::kCapture);
  }
  parts_.health->SetReplaced(mailbox_.replaced());
}

void Pipeline::LocalizeFrames() {
  answerer_.emplace();
  Frame frame;
  while (!stop_ && Turn(frame)) parts_.health->Beat(Health::kLocalize);
  localizing_ = false;
  parts_.health->Retire(Health::kLocalize);
  on_end_();
}

// False: all is answered, or nothing can be published any more.
bool Pipeline::Turn(Frame& frame) {
  if (!WaitUntilDue()) return true;
  const FrameMailbox::Taken taken = mailbox_.Take(frame, kPatience);
  if (taken == FrameMailbox::Taken::kEnded) return false;
  if (taken == FrameMailbox::Taken::kNothing) return SayWhyNothing();
  last_sequence_ = frame.sequence;
  if (std::shared_ptr<LoadedModel> current = parts_.models->Current(); current != model_) {
    model_ = std::move(current);
    answerer_.emplace();  // what was known of the motion was of the old map
    scene_ = SceneChange();
    colours_looked_for_ = false;
  }
  if (model_ == nullptr) return SayWhyNothing();
  LookForColours(frame);
  if (live_ && Still(frame)) return true;
  return Answer(frame);
}

// Once a model; frames that the model before wanted without colours say nothing of the camera.
void Pipeline::LookForColours(const Frame& frame) {
  const bool matters = TypeOf(*model_) == FeatureType::kColorSurf;  // all descriptors would differ
  if (colours_looked_for_ || !matters || frame.image.luma_only) return;
  colours_looked_for_ = true;
  if (!frame.image.view().chroma.empty()) return;
  log_.Write(LogLevel::kWarning,
             "the model knows places by their colours, too, and frames come without: choose "
             "another pixel format, or train it with --features surf");
}

// Until a frame may begin at max_fps. False: the time was not over yet; beat and come again.
bool Pipeline::WaitUntilDue() {
  std::unique_lock lock(mutex_);
  const std::int64_t due_ns = began_ns_ + IntervalNs(rates_.max_fps);
  const std::int64_t wait_ns = due_ns - MonotonicNs();
  if (rates_.max_fps <= 0 || wait_ns <= 0) return true;
  const std::int64_t patience_ns = nanoseconds(kPatience).count();
  wake_.wait_for(lock, nanoseconds(std::min(wait_ns, patience_ns)), [&] { return stop_.load(); });
  return wait_ns <= patience_ns && !stop_;
}

// Whether this frame may be passed over because it shows what the last one answered showed.
bool Pipeline::Still(const Frame& frame) {
  std::int64_t idle_ns, busy_ns;
  {
    const std::lock_guard lock(mutex_);
    idle_ns = IntervalNs(rates_.idle_fps);
    busy_ns = IntervalNs(rates_.max_fps);
  }
  if (idle_ns == 0) return false;
  const std::int64_t now_ns = MonotonicNs();
  if (scene_.Differs(frame.image.view())) moved_ns_ = now_ns;
  const bool idle = now_ns - moved_ns_ > kIdleAfterNs;
  parts_.health->SetIdle(idle);
  wanted_interval_ns_ = idle ? std::min(idle_ns, kIdleLookNs) : busy_ns;
  if (!idle || now_ns - began_ns_ >= idle_ns) return false;
  parts_.health->CountIdle();
  return true;
}

// The motion between frames is counted in frames of a tenth of a second, LocalizerOptions'
// frame_interval_s. A recording's own frames are those, so that it gives the same at any speed; of
// a camera it depends on the time between two answers, a sleep of the machine included, and after a
// second nothing is known of the motion.
std::uint64_t Pipeline::NumberOf(const Frame& frame) {
  if (!live_) return frame.sequence;
  const std::int64_t captured_ns = frame.capture_time_ns + SleptNs();
  const std::int64_t passed_ns = captured_ns - std::exchange(captured_ns_, captured_ns);
  const std::int64_t steps = (passed_ns + kNominalNs / 2) / kNominalNs;
  number_ += static_cast<std::uint64_t>(std::clamp<std::int64_t>(steps, 1, kForgetAfter));
  return number_;
}

bool Pipeline::Answer(Frame& frame) {
  began_ns_ = MonotonicNs();
  scene_.SetReference(frame.image.view());
  parts_.models->FrameReceived();
  parts_.health->BeginFrame();
  const Result<Fix> fix = answerer_->Localize(frame, NumberOf(frame), *model_);
  parts_.health->EndFrame();
  parts_.models->FrameProcessed();
  if (!fix.ok()) {
    log_.Write(fix.status());
    parts_.health->CountFailed();
    return true;
  }
  parts_.health->CountFix(*fix);
  said_state_.clear();
  const std::string_view line = WriteFix(frame, *fix, *model_);
  const std::lock_guard publishing(publish_mutex_);
  if (stop_) return false;
  if (parts_.show) parts_.show(frame.image, model_->localizer->SeenPoints());
  return Publish(line);
}

// Once a second while camera or model are missing.
bool Pipeline::SayWhyNothing() {
  if (!live_) return true;
  const std::string state = parts_.health->State();
  if (state != "no_camera" && state != "no_model") return true;
  const std::int64_t now_ns = MonotonicNs();
  if (state == said_state_ && now_ns - said_ns_ < kSecondNs) return true;
  said_state_ = state;
  said_ns_ = now_ns;
  const std::string hash = parts_.health->model();
  const std::string detail =
      state == "no_camera" ? parts_.health->camera().text : parts_.health->model_fault();
  WriteStateLine({state, last_sequence_, hash, detail, now_ns, WallClockNs()}, state_line_);
  const std::lock_guard publishing(publish_mutex_);
  return !stop_ && Publish(state_line_.text());
}

bool Pipeline::Publish(std::string_view line) {
  fault_ = parts_.publisher->Publish(line);
  return fault_.ok();
}

}  // namespace viewfix
