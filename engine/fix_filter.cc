// SPDX-License-Identifier: BSD-3-Clause
#include "engine/fix_filter.h"

#include <algorithm>

#include "engine/base/location_name.h"

namespace viewfix {
namespace {

// Nothing is quite certain: the next frame may know better.
constexpr double kMostCertain = 0.999;
// How fast what was known fades, a frame: towards one half, that is to nothing. Walks through a
// building at a frame a second change their area every 25 frames.
constexpr double kFading = 0.05;
// Poses farther apart contradict each other, a frame: a runner at three frames a second.
constexpr double kMaxMetresPerFrame = 1;

// A contradicted pose that is more likely wrong than right is withheld.
constexpr float kLeastOfPoses = 0.5F;

double Bounded(double confidence) { return std::clamp(confidence, 1 - kMostCertain, kMostCertain); }

// The first of two exclusive hypotheses, whose odds are multiplied.
double Posterior(double prior, double likelihood) {
  const double both = prior * likelihood;
  return both / (both + (1 - prior) * (1 - likelihood));
}

}  // namespace

FixFilter::FixFilter(const ModelView& model) : model_(model) {}

void FixFilter::Apply(std::uint64_t sequence, Fix& fix) {
  Fade(sequence);
  if (!fix.localized) return;
  if (!place_) return Begin(sequence, fix);
  if (Agrees(sequence, fix)) return Raise(sequence, fix);
  Lower(sequence, fix);
  if (fix.confidence < LeastConfidence(fix)) Withhold(fix);
}

void FixFilter::Fade(std::uint64_t sequence) {
  if (place_ && (sequence <= now_ || sequence - place_->sequence > kMaxGap)) place_.reset();
  if (place_) {
    for (; now_ < sequence; ++now_) belief_ = 0.5 + (belief_ - 0.5) * (1 - kFading);
  }
  now_ = sequence;
}

int FixFilter::LevelsOfAnswer(const Fix& fix) const {
  return fix.level == 0 ? LevelsOf(model_.location_name(fix.location_idx)) : fix.level;
}

bool FixFilter::Agrees(std::uint64_t sequence, const Fix& fix) const {
  const Fix& before = place_->fix;
  if (fix.has_pose && before.has_pose && fix.map_idx == before.map_idx &&
      model_.metric(fix.map_idx)) {
    const double reach = kMaxMetresPerFrame * static_cast<double>(sequence - place_->sequence);
    return (fix.world_from_cam.translation - before.world_from_cam.translation).norm() <= reach;
  }
  const int common = CommonLevels(model_.location_name(fix.location_idx),
                                  model_.location_name(before.location_idx));
  return common >= std::min(LevelsOfAnswer(fix), LevelsOfAnswer(before));
}

// The model's threshold is on the curve of answers without a pose.
float FixFilter::LeastConfidence(const Fix& fix) const {
  return fix.has_pose ? kLeastOfPoses : model_.confidence().threshold;
}

void FixFilter::Begin(std::uint64_t sequence, const Fix& fix) {
  place_ = Place{sequence, fix};
  belief_ = Bounded(std::max(0.5F, fix.confidence));
}

void FixFilter::Raise(std::uint64_t sequence, Fix& fix) {
  const int levels = LevelsOfAnswer(fix);
  const int levels_before = LevelsOfAnswer(place_->fix);
  if (levels > levels_before) return Begin(sequence, fix);
  const double posterior = Posterior(belief_, Bounded(fix.confidence));
  fix.confidence = std::max(fix.confidence, static_cast<float>(posterior));
  // Who names the floor alone says nothing of the area.
  if (levels == levels_before) Begin(sequence, fix);
}

void FixFilter::Lower(std::uint64_t sequence, Fix& fix) {
  const double posterior = Posterior(1 - belief_, Bounded(fix.confidence));
  fix.confidence = std::min(fix.confidence, static_cast<float>(posterior));
  if (posterior > 0.5) {
    Begin(sequence, fix);
  } else {
    belief_ = Bounded(1 - posterior);
  }
}

void FixFilter::Withhold(Fix& fix) const {
  fix.localized = false;
  fix.level = 0;
  fix.has_pose = false;
  fix.map_idx = -1;
  fix.world_from_cam = {};
  fix.covariance.setZero();
  fix.reasons |= kAmbiguous;
  const int before = place_->fix.location_idx;
  if (before == fix.location_idx) return;
  // The place before heads the rivals; the last makes room where there are too many.
  int* const end = fix.rivals + fix.num_rivals;
  int* place = std::find(fix.rivals, end, before);
  if (place == end && fix.num_rivals < Fix::kMaxRivals) ++fix.num_rivals;
  place = std::min(place, fix.rivals + Fix::kMaxRivals - 1);
  std::copy_backward(fix.rivals, place, place + 1);
  fix.rivals[0] = before;
}

}  // namespace viewfix
