// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>

#include "engine/localizer.h"
#include "engine/pose/motion_model.h"
#include "models/model_view.h"

namespace viewfix {

// Agreement over the frames of one stream. Of two frames that follow each other, either the second
// shows the place where the camera was, or another that is mistaken for it: by Bayes' rule, with
// p the confidence in the place so far and c that of the frame alone,
//
//     agreement      p c / (p c + (1 - p) (1 - c))           never less than c, for p >= 1/2
//     contradiction  (1 - p) c / ((1 - p) c + p (1 - c))     never more
//
// and p fades by each frame: p - 1/2 is multiplied by 0.95. Only two hypotheses, because
// frames are no independent witnesses: what one is mistaken for, the next will be too.
// Two frames agree if their poses, in one metric map, are within reach; where either has none, if
// their locations are the same, as far as both are answered. An area is not surer for the floor's
// having been right: an answer of more levels than the one before begins anew.
//
// The filter changes the confidence of answers alone, and withholds those whose confidence falls
// below the model's threshold (kAmbiguous, the place before as the rival). It never answers for a
// frame that has no answer. No heap. One instance serves one stream.
class FixFilter {
 public:
  // So many frames later nothing is known any more.
  static constexpr std::uint64_t kMaxGap = MotionModel::kMaxGap;

  // `model` is borrowed and must outlive the filter.
  explicit FixFilter(const ModelView& model);

  // `fix` of frame `sequence`; where numbers do not grow, the stream begins anew.
  void Apply(std::uint64_t sequence, Fix& fix);

 private:
  struct Place {
    std::uint64_t sequence;  // that it was seen in
    Fix fix;
  };

  void Fade(std::uint64_t sequence);
  float LeastConfidence(const Fix& fix) const;
  int LevelsOfAnswer(const Fix& fix) const;
  bool Agrees(std::uint64_t sequence, const Fix& fix) const;
  void Begin(std::uint64_t sequence, const Fix& fix);
  void Raise(std::uint64_t sequence, Fix& fix);
  void Lower(std::uint64_t sequence, Fix& fix);
  void Withhold(Fix& fix) const;

  const ModelView& model_;
  std::optional<Place> place_;  // where the camera was
  double belief_ = 0;           // in it, at frame now_
  std::uint64_t now_ = 0;
};

}  // namespace viewfix
