// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>

#include "engine/base/status.h"
#include "engine/features/feature_extractor.h"
#include "engine/geometry/camera.h"
#include "engine/geometry/rigid3.h"
#include "engine/image/image_view.h"
#include "engine/pose/pose_finder.h"
#include "engine/vocabulary/vocabulary.h"
#include "models/model_view.h"

namespace viewfix {

// Fewer features than this describe no place.
inline constexpr int kMinFeatures = 16;

// Why a frame was not localized, or why its fix is doubtful. Bits of Fix::reasons.
enum Reason : std::uint32_t {
  kTooFewFeatures = 1U << 0,
  kUnknownPlace = 1U << 1,
  kAmbiguous = 1U << 2,
  kLowInliers = 1U << 3,
  // Of the image (image/image_quality.h): what may have kept the frame from being localized.
  kBlurred = 1U << 4,
  kDark = 1U << 5,
  kOverexposed = 1U << 6,
};
// "too_few_features", ...: the names used in JSON.
const char* ReasonName(Reason reason);
inline constexpr Reason kAllReasons[] = {kTooFewFeatures, kBlurred,   kDark,      kOverexposed,
                                         kUnknownPlace,   kAmbiguous, kLowInliers};

// Milliseconds by stage; zero when the options carry no clock.
struct StageTimes {
  float features = 0;
  float score = 0;
  float verify = 0;
  float pose = 0;
  float total = 0;
};

struct Fix {
  static constexpr int kMaxRivals = 4;

  bool localized = false;
  std::uint32_t reasons = 0;  // bits of Reason
  // 0: the answer is whole. Else it is as much as the first so many parts of the location's name
  // ("floor10" of "floor10/lobby"), with neither view, keyframe nor pose: the rest is a guess.
  int level = 0;
  // Best guess, also when not localized; -1: none. Indices into the model's tables.
  int location_idx = -1;
  int pair_idx = -1;      // (location, view)
  int keyframe_idx = -1;  // nearest by histogram inside the pair
  float confidence = 0;   // 0..1, probability that the location, as far as answered, is right
  // Where the camera stands; only if this very frame was localized against landmarks.
  bool has_pose = false;
  bool tracked = false;  // found where Prior said; such a frame is not scored
  int map_idx = -1;      // of the model's maps; each has its own frame of reference
  Rigid3 world_from_cam = {};
  // Of [camera centre in world units; left rotation vector of world_from_cam in radians].
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  // Landmarks that agree with the pose; without landmarks, features whose nearest detail is of the
  // location (matching/place_evidence.h).
  int num_inliers = 0;
  // What they say, each weighed by its rarity; what would be said if all landmarks in sight of
  // the pose were found; and what speaks for the best pose elsewhere (pose/pose_finder.h). Of
  // details: what speaks for the location, and for the best other.
  float evidence = 0;
  float expected_evidence = 0;
  // Share of the image's parts where landmarks should be seen in which some agree with the pose,
  // 0..1.
  float evidence_spread = 0;
  float rival_evidence = 0;
  float score = 0;     // f_{l,t}(x) of the best pair, eq. (5) of method.md
  float margin = 0;    // location's score, keyframes counted in, less the best other's; below
                       // zero where landmarks overrule the scores; where the model has details,
                       // BestPlace's
  int num_rivals = 0;  // other locations close to the best, best first
  int rivals[kMaxRivals] = {};
  int num_features = 0;
  StageTimes ms = {};

  // Whether the best guess is not said itself, and stands before the rivals as one of the places
  // that the frame may show.
  bool GuessIsRival() const {
    return (reasons & kAmbiguous) != 0 && num_rivals > 0 && (!localized || level != 0);
  }
};

// How the features that a model was made of are found.
FeatureOptions FeatureOptionsOf(const ModelFeatures& features);

struct LocalizerOptions {
  // Nanoseconds of a monotonic clock, for StageTimes; null: not measured. The engine
  // itself has no clock, and no result depends on this one.
  std::int64_t (*now_ns)() = nullptr;
  PoseFinderOptions pose = {};
  // A location counts as a rival when its score is within this of the best.
  float rival_margin = 0.25F;
  // Frames whose poses are adjusted together (pose/window_adjuster.h), 3..8; 0: each frame's pose
  // is its own. For a camera that moves steadily, in maps whose units are metres; in others poses
  // stay as they are.
  int window = 0;
  // Between two frames whose sequence numbers differ by one, > 0: what a board gets through.
  // Nominal, so that a recording gives the same whatever the speed it is read at.
  double frame_interval_s = 0.1;
};

// What a caller knows before looking.
struct Prior {
  // The camera, at the size of the image given or any of the same shape; null: the model's
  // own if the image has its shape, else a guess whose focal length is refined with the pose.
  const Camera* camera = nullptr;
  // Where the camera should stand, as predicted from the frames before: tried first. Null:
  // nothing is known.
  const Rigid3* cam_from_world = nullptr;
  int map_idx = 0;  // the map that cam_from_world is of
  // Counts the camera's frames. Only the window asks: it begins anew where numbers do not grow.
  std::uint64_t sequence = 0;
};

// A key point of a frame, for people to look at.
struct SeenPoint {
  float x = 0;  // pixels of the image given, centres at integers
  float y = 0;
  float radius_px = 0;
  bool matched = false;  // it speaks for the fix: agrees with the pose or, without landmarks, is
                         // like nothing so much as a detail of the location
};

// The engine. Create() checks and allocates everything; Localize() allocates nothing,
// bounds every loop and is deterministic. Frames do not influence each other but through Prior
// and the window. One instance serves one thread.
class Localizer {
 public:
  // `model` is borrowed and must outlive the localizer. `extractor`: features other than
  // the board's own (laptop only); null: made from the model's options. kUnsupported: the
  // model's features cannot be reproduced by this build; kInvalidArgument: an option is out of
  // range.
  static Result<Localizer> Create(const ModelView& model, const LocalizerOptions& options,
                                  std::unique_ptr<FeatureExtractor> extractor = nullptr);
  Localizer(Localizer&&) noexcept;
  Localizer& operator=(Localizer&&) noexcept;
  ~Localizer();

  // Where `image` was taken. Not knowing is an answer (Fix::localized == false, with
  // reasons). Errors: an empty view, one larger than kMaxImageSide / kMaxImagePixels, a
  // prior camera that is not valid or has another shape than the image, or a prior pose that is
  // not finite or no rotation.
  Result<Fix> Localize(const ImageView& image, const Prior& prior = {});

  // Of the last Localize(): the score of every (location, view) pair, eq. (5) alone; the score
  // of every location with what keyframes add (scoring/scoring.h); and every keyframe's
  // similarity to the frame (retrieval/retrieval.h). Zero where the frame was not scored.
  std::span<const float> pair_scores() const;
  std::span<const float> location_scores() const;
  std::span<const float> keyframe_similarities() const;
  // Of the last Localize(): the frame's key points. Valid until the next call of either.
  std::span<const SeenPoint> SeenPoints();

 private:
  struct State;
  explicit Localizer(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace viewfix
