// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <memory>
#include <span>

#include "engine/base/status.h"
#include "engine/features/feature_extractor.h"
#include "engine/geometry/camera.h"
#include "engine/geometry/rigid3.h"
#include "engine/pose/pose_match.h"
#include "engine/pose/pose_refiner.h"
#include "models/model_view.h"

namespace viewfix {

struct PoseFinderOptions {
  // Landmarks that one frame is matched with at most, 64..65536: those of the keyframes most
  // alike, about 300 each. More take time and find little.
  int max_landmarks = 3000;
  // Groups of keyframes that see the same landmarks, tried one after another, >= 1.
  int max_groups = 6;
  // A pose that many matches agree with ends the search, but for groups whose promise comes so
  // close to the best's, >= 0, and a look-alike: such places are compared by what agrees with each.
  float rival_promise = 1.0F;
  // Matches that must agree on a pose, >= 4.
  int min_inliers = 15;
  // How much they must say, each weighed by its landmark's rarity, > 0.
  float min_evidence = 3;
  // And what share of the landmarks that the pose puts into the image, weighed likewise, 0..1: a
  // door like any other is a small part of what should be seen. Which of the poses that pass all
  // this are right, the model's confidence tells.
  float min_evidence_share = 0.05F;
  // The same of a pose found where one was predicted, 0..1: it has no rivals to be compared with,
  // and if less is found, the whole search costs time only. Nine right poses in ten have
  // 0.6 or more (HoloLens); one with 0.53 was 3 cm off where the whole search was not.
  float min_tracked_share = 0.6F;
  // Greatest ratio of the distances to the nearest and second nearest landmark, 0..1. Mild:
  // one thing seen by several keyframes can be several landmarks.
  float max_ratio = 0.9F;
  // Guided matching looks so far around where a landmark must be seen, pixels, > 0: about a
  // pose found among a few landmarks, and about one predicted from the frame before.
  double guided_radius_px = 8;
  double tracking_radius_px = 24;
  // Greatest distance of descriptors in guided matching; their length is 127.
  int max_guided_distance = 70;

  Status Validate() const;
};

// A keyframe that the frame may show, and how likely it seems: larger is likelier.
struct ProposedKeyframe {
  int keyframe_idx = 0;
  float promise = 0;
};

// What speaks for a pose elsewhere, of a look-alike place say: its evidence, and what features say
// that are more like a landmark of the one than of the other.
struct PoseRival {
  float evidence = 0;
  int keyframe_idx = -1;  // as FoundPose's
  int map_idx = -1;
  Rigid3 cam_from_world;
};

struct FoundPose {
  static constexpr int kMaxRivals = 4;

  bool found = false;
  int map_idx = -1;
  int keyframe_idx = -1;  // the nearest of those that share most of the matched landmarks
  int num_inliers = 0;    // matches that agree with the pose
  float evidence = 0;     // the same, each weighed by its landmark's rarity, 0..1
  float expected = 0;     // evidence, if all landmarks that the pose puts into the image were seen
  float spread = 0;  // share of the image's parts with landmarks to be seen where some are, 0..1
  std::array<PoseRival, kMaxRivals> rivals;  // the best poses elsewhere that were tried, best first
  RefinedPose pose;                          // camera from the map's frame of reference
  Camera camera;  // that it is the pose of: the focal length refined, if it was a guess
};

// Where a camera stands among a model's landmarks: matches the frame's features with the
// landmarks of the keyframes proposed, finds the pose by P3P in a locally optimized RANSAC, then
// looks for more landmarks where they must be seen, and refines the pose again over all of them
// (method.md, section 2). Create() allocates; finding does not, is deterministic and bounded.
// One instance serves one thread.
class PoseFinder {
 public:
  // `model` is borrowed, has landmarks, and must outlive the finder.
  static Result<PoseFinder> Create(const ModelView& model, const PoseFinderOptions& options);
  PoseFinder(PoseFinder&&) noexcept;
  PoseFinder& operator=(PoseFinder&&) noexcept;
  ~PoseFinder();

  // `proposed`: most promising first. `camera`: of the image that features were found in;
  // `refine_focal`: its focal length is a guess. `look_alikes`: keyframes of places that may be
  // what the frame shows, too; the first that shows another than the pose found is tried in any
  // case. No pose is an outcome, not an error.
  FoundPose Find(const FeatureSet& features, const Camera& camera, bool refine_focal,
                 std::span<const ProposedKeyframe> proposed,
                 std::span<const ProposedKeyframe> look_alikes = {});

  // The same among the matches of guided matching about a pose that is nearly right, as that
  // predicted from the frame before. Found only if much of what should be seen is: else Find()
  // may know better.
  FoundPose FindNear(const FeatureSet& features, const Camera& camera, bool refine_focal,
                     int map_idx, const Rigid3& cam_from_world);

  // Of the last pose that was found: [num_inliers], in pixels of its camera.
  std::span<const PoseMatch> inliers() const;

 private:
  struct State;
  explicit PoseFinder(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace viewfix
