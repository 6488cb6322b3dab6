// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pose/pose_finder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "engine/base/exp.h"
#include "engine/matching/descriptor_matcher.h"
#include "engine/matching/feature_grid.h"
#include "engine/pose/absolute_pose.h"
#include "engine/pose/model_geometry.h"

namespace viewfix {
namespace {

// A pose begun with fewer agreeing matches than this is not worth growing.
constexpr int kMinStart = 6;
// So many times min_inliers end the search among groups.
constexpr int kCertainTimes = 3;
// Keyframes whose landmarks are looked for around a pose.
constexpr int kNeighbours = 12;
// Views more unlike than this are not finite.
constexpr double kNoView = 1e30;
// Keyframes of a group share one landmark of so many with it; a few are shared by look-alike
// places, too, through wrong matches in training.
constexpr int kSharedOfLandmarks = 10;
// Samples drawn among the matches about a predicted pose: where a quarter of them is right, all
// but one frame in twenty need fewer, and a poor prediction must not cost more than the whole
// search that follows.
constexpr int kTrackingIterations = 200;
// Rounds of guided matching; the radius shrinks to kFinalRadiusSigma after the first.
constexpr int kRounds = 3;
constexpr double kFinalRadiusSigma = 5;
constexpr double kInlierSigma = 3.5;

// Of two poses that stand elsewhere, what the features say that have a landmark of each where they
// are, and the one no farther than kSameThing: whose is more alike, in descriptor and in chroma
// (where colours are the same, light alone makes differences to kLeastNearerInChroma). What one
// feature says, and all, is cut, and is the logarithm of a factor to the evidence.
constexpr float kSameThing = 70;
constexpr float kMostNearer = 40;
constexpr float kLeastNearerInChroma = 20;
constexpr float kMostNearerInChroma = 60;
constexpr float kFavourOfNearer = 0.05F;
constexpr float kFavourOfNearerInChroma = 0.2F;
constexpr float kMostFavour = 2;
constexpr auto kWorthComparing = static_cast<float>(Exp(-double{kMostFavour}));
static_assert(kChromaDim == kLandmarkChromaDim);

std::int32_t SquaredDistance(const std::int8_t* a, const std::int8_t* b, int dim) {
  std::int32_t sum = 0;
  for (int i = 0; i < dim; ++i) {
    const std::int32_t difference = std::int32_t{a[i]} - b[i];
    sum += difference * difference;
  }
  return sum;
}

// Of a feature and the landmark that a pose puts where it is.
struct Likeness {
  float distance = -1;         // of the descriptors; < 0: there is no landmark
  float chroma_distance = -1;  // < 0: the colours of one are not known
};

// What a feature says for the first of two landmarks rather than the second.
float SaidFor(const Likeness& first, const Likeness& second) {
  if (first.distance < 0 || second.distance < 0) return 0;
  if (std::min(first.distance, second.distance) > kSameThing) return 0;
  const auto share = [](float difference, float least, float most) {
    const float beyond = std::max(0.0F, std::abs(difference) - least) / (most - least);
    return std::copysign(std::min(1.0F, beyond), difference);
  };
  const float said = kFavourOfNearer * share(second.distance - first.distance, 0, kMostNearer);
  if (first.chroma_distance < 0 || second.chroma_distance < 0) return said;
  return said + kFavourOfNearerInChroma * share(second.chroma_distance - first.chroma_distance,
                                                kLeastNearerInChroma, kMostNearerInChroma);
}

// Landmarks in each part of an image.
constexpr int kPartsAcross = 4, kPartsDown = 3;
using ImageParts = std::array<int, kPartsAcross * kPartsDown>;
// Landmarks that must be expected in a part for it to count, and how many times as many as agree.
constexpr int kLeastExpected = 4;
constexpr int kExpectedOfAgreeing = 8;

int PartOf(const Camera& camera, const Eigen::Vector2d& pixel) {
  const auto part = [](double x, int size, int parts) {
    return std::clamp(static_cast<int>(x * parts / size), 0, parts - 1);
  };
  return part(pixel.y(), camera.height, kPartsDown) * kPartsAcross +
         part(pixel.x(), camera.width, kPartsAcross);
}

float SpreadOf(const ImageParts& expected, const ImageParts& agreeing) {
  int counted = 0, confirmed = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    if (expected[i] < kLeastExpected) continue;
    ++counted;
    confirmed += agreeing[i] * kExpectedOfAgreeing >= expected[i] ? 1 : 0;
  }
  return counted > 0 ? static_cast<float>(confirmed) / static_cast<float>(counted) : 1;
}

// How unlike two views are: the squared distance in units of `pace`, and one more for every 30
// degrees or so between the optical axes.
double Unlike(const Rigid3& world_from_a, const Rigid3& world_from_b, double pace) {
  const Eigen::Vector3d axis_a = world_from_a.rotation * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d axis_b = world_from_b.rotation * Eigen::Vector3d::UnitZ();
  return (world_from_a.translation - world_from_b.translation).squaredNorm() / (pace * pace) +
         8 * (1 - axis_a.dot(axis_b));
}

}  // namespace

Status PoseFinderOptions::Validate() const {
  const bool valid = max_landmarks >= 64 && max_landmarks <= 65536 && max_groups >= 1 &&
                     min_inliers >= 4 && max_ratio >= 0 && max_ratio <= 1 && min_evidence > 0 &&
                     min_evidence_share >= 0 && min_evidence_share <= 1 && min_tracked_share >= 0 &&
                     min_tracked_share <= 1 && rival_promise >= 0 && guided_radius_px > 0 &&
                     tracking_radius_px > 0 && max_guided_distance > 0 &&
                     max_guided_distance <= 2048;
  return valid ? Status() : Status(StatusCode::kInvalidArgument, "pose finder option out of range");
}

struct PoseFinder::State {
  State(const ModelView& model_view, const PoseFinderOptions& finder_options,
        AbsolutePoseEstimator pose_estimator, AbsolutePoseEstimator tracking_estimator)
      : model(model_view),
        landmarks(model.landmarks()),
        keyframes(model.keyframes()),
        options(finder_options),
        dim(model.features().descriptor_dim),
        estimator(std::move(pose_estimator)),
        tracker(std::move(tracking_estimator)),
        matcher(model.features().max_features, options.max_landmarks, dim),
        grid(model.features().max_features),
        stamp_of_landmark(landmarks.size, 0),
        tried(keyframes.size, 0),
        votes(keyframes.size, 0) {
    const std::size_t features = model.features().max_features;
    candidates.reserve(options.max_landmarks);
    descriptors.resize(std::size_t(options.max_landmarks) * dim);
    signs.resize(options.max_landmarks);
    feature_signs.resize(features);
    descriptor_matches.resize(features);
    landmark_of_feature.resize(features);
    distance_of_feature.resize(features);
    matches.reserve(features);
    matched_landmarks.reserve(features);
    kept_inliers.reserve(features);
    used.reserve(features);
    likeness_of_best.resize(features);
    likeness_of_other.resize(features);
    ranked.reserve(keyframes.size);
    IndexKeyframes();
    MeasurePaces();
  }

  void IndexKeyframes();
  void MeasurePaces();
  double PaceOf(int map) const { return paces[map]; }
  float RarityOf(std::uint32_t landmark) const;
  double SigmaOf(const Keypoint& keypoint) const;
  std::span<const std::uint32_t> LandmarksOf(int k) const;

  void ClearCandidates();
  int CountShared(int k) const;
  bool AddCandidatesOf(int k);
  const ProposedKeyframe* GatherGroup(std::span<const ProposedKeyframe> proposed);
  int LocationOf(int k) const;
  bool IsOfAnotherPlace(int k, const FoundPose& best);
  void TryCandidates(const FeatureSet& features, const Camera& camera, bool refine_focal,
                     FoundPose& best);
  void TryLookAlike(const FeatureSet& features, const Camera& camera, bool refine_focal,
                    std::span<const ProposedKeyframe> look_alikes, FoundPose& best);
  void MatchCandidates(const FeatureSet& features);
  void AddMatch(const Keypoint& keypoint, std::uint32_t landmark);

  void GatherCovisible();
  void GatherNear(int map, const Rigid3& cam_from_world);
  bool IsInImage(const Camera& camera, const Rigid3& cam_from_world, std::uint32_t landmark,
                 double margin_px, Eigen::Vector2d& pixel) const;
  template <typename Visit>
  void ForEachNear(const FeatureSet& features, std::uint32_t landmark, const Eigen::Vector2d& pixel,
                   double radius_px, const Visit& visit) const;
  std::int32_t SquaredDistanceTo(const FeatureSet& features, int f, std::uint32_t landmark) const;
  void MatchGuided(const FeatureSet& features, const Camera& camera, const Rigid3& cam_from_world,
                   double radius_px);
  int MarkInliers(const Camera& camera, const Rigid3& cam_from_world);
  bool Refine(const Camera& camera, const PoseRefinerOptions& refiner, RefinedPose& pose);
  FoundPose FindAmongMatches(const FeatureSet& features, const Camera& camera, bool refine_focal,
                             AbsolutePoseEstimator& by);
  FoundPose Grow(const FeatureSet& features, Camera camera, bool refine_focal, RefinedPose start);
  void Describe(const Camera& camera, FoundPose& found);
  bool Convincing(const FoundPose& found, int min_inliers) const;
  bool StandsElsewhere(const FoundPose& pose, int map_idx, const Rigid3& cam_from_world) const;
  Likeness LikenessOf(const FeatureSet& features, int f, std::uint32_t landmark) const;
  void Compare(const FeatureSet& features, const FoundPose& found, std::vector<Likeness>& likeness);
  float FavourOf(const FeatureSet& features, const FoundPose& found, const FoundPose& best);
  bool TakeIfBetter(const FeatureSet& features, const FoundPose& found, FoundPose& best);
  void KeepInliers();
  void StartFrame(const FeatureSet& features);

  ModelView model;
  ModelLandmarks landmarks;
  ModelKeyframes keyframes;
  PoseFinderOptions options;
  int dim;
  AbsolutePoseEstimator estimator;
  AbsolutePoseEstimator tracker;  // the same with fewer samples
  DescriptorMatcher matcher;
  FeatureGrid grid;

  // Keyframes that see a landmark: seen_by[seen_by_begin[l] .. seen_by_begin[l + 1]).
  std::vector<std::uint32_t> seen_by_begin;
  std::vector<std::uint32_t> seen_by;
  std::vector<double> paces;  // [maps] a step in it: a metre or so, whatever its unit

  std::vector<std::uint32_t> candidates;         // landmarks to be matched, each once
  std::vector<std::uint32_t> stamp_of_landmark;  // == stamp: is a candidate
  std::uint32_t stamp = 0;
  std::vector<std::int8_t> descriptors;  // of the candidates
  std::vector<std::int8_t> signs;
  std::vector<std::int8_t> feature_signs;
  std::vector<std::uint8_t> tried;             // [keyframes] in this frame
  std::vector<int> votes;                      // [keyframes] landmarks shared with the matches
  std::vector<std::pair<double, int>> ranked;  // keyframes

  std::vector<DescriptorMatch> descriptor_matches;
  std::vector<std::int64_t> landmark_of_feature;  // -1: none
  std::vector<std::int32_t> distance_of_feature;
  std::vector<PoseMatch> matches;
  std::vector<std::uint32_t> matched_landmarks;  // [matches]
  std::vector<std::uint8_t> used;                // [matches] inliers
  std::vector<PoseMatch> kept_inliers;           // of the best pose so far
  std::vector<Likeness> likeness_of_best;        // [features], where is_best_compared
  std::vector<Likeness> likeness_of_other;       // [features]
  bool is_best_compared = false;
};

void PoseFinder::State::IndexKeyframes() {
  seen_by_begin.assign(std::size_t(landmarks.size) + 1, 0);
  for (const std::uint32_t l : keyframes.landmarks) ++seen_by_begin[l + 1];
  for (int l = 0; l < landmarks.size; ++l) seen_by_begin[l + 1] += seen_by_begin[l];
  seen_by.resize(keyframes.landmarks.size());
  std::vector<std::uint32_t> next(seen_by_begin.begin(), seen_by_begin.end() - 1);
  for (int k = 0; k < keyframes.size; ++k) {
    for (const std::uint32_t l : LandmarksOf(k)) seen_by[next[l]++] = static_cast<std::uint32_t>(k);
  }
}

// A quarter of the mean distance from keyframes to what they see: a map's unit may be anything.
void PoseFinder::State::MeasurePaces() {
  paces.assign(landmarks.num_maps, 0);
  std::vector<double> observations(landmarks.num_maps, 0);
  for (int k = 0; k < keyframes.size; ++k) {
    const Eigen::Vector3d position = KeyframePose(keyframes, k).translation;
    for (const std::uint32_t l : LandmarksOf(k)) {
      const int map = model.MapOf(l);
      paces[map] += (LandmarkPosition(model, l) - position).norm();
      ++observations[map];
    }
  }
  for (int map = 0; map < landmarks.num_maps; ++map) {
    const bool measured = observations[map] > 0 && paces[map] > 0;
    paces[map] = measured ? paces[map] / (4 * observations[map]) : 1;
  }
}

std::span<const std::uint32_t> PoseFinder::State::LandmarksOf(int k) const {
  const std::uint32_t begin = keyframes.landmark_begin[k];
  return keyframes.landmarks.subspan(begin, keyframes.landmark_begin[k + 1] - begin);
}

float PoseFinder::State::RarityOf(std::uint32_t landmark) const {
  return static_cast<float>(landmarks.rarity[landmark]) / 255;
}

double PoseFinder::State::SigmaOf(const Keypoint& keypoint) const {
  return double{landmarks.pixel_sigma} * double{keypoint.sigma};
}

void PoseFinder::State::StartFrame(const FeatureSet& features) {
  grid.Fill(features.keypoints());
  for (int i = 0; i < features.size(); ++i) {
    feature_signs[i] = features.keypoints()[i].laplacian_sign;
  }
  std::fill(tried.begin(), tried.end(), std::uint8_t{0});
  is_best_compared = false;
}

void PoseFinder::State::ClearCandidates() {
  candidates.clear();
  if (++stamp == 0) {
    std::fill(stamp_of_landmark.begin(), stamp_of_landmark.end(), 0U);
    stamp = 1;
  }
}

int PoseFinder::State::CountShared(int k) const {
  int shared = 0;
  for (const std::uint32_t l : LandmarksOf(k)) shared += stamp_of_landmark[l] == stamp ? 1 : 0;
  return shared;
}

// False: there is no room left.
bool PoseFinder::State::AddCandidatesOf(int k) {
  for (const std::uint32_t l : LandmarksOf(k)) {
    if (stamp_of_landmark[l] == stamp) continue;
    if (static_cast<int>(candidates.size()) == options.max_landmarks) return false;
    stamp_of_landmark[l] = stamp;
    candidates.push_back(l);
  }
  return true;
}

// The first keyframe not tried yet, and those after it that see the same landmarks. Null: all
// have been tried.
const ProposedKeyframe* PoseFinder::State::GatherGroup(std::span<const ProposedKeyframe> proposed) {
  ClearCandidates();
  const ProposedKeyframe* first = nullptr;
  for (const ProposedKeyframe& p : proposed) {
    const int k = p.keyframe_idx;
    if (tried[k] != 0 || LandmarksOf(k).empty()) continue;
    const auto seen = static_cast<int>(LandmarksOf(k).size());
    if (first != nullptr && CountShared(k) * kSharedOfLandmarks < seen) continue;
    if (first == nullptr) first = &p;
    tried[k] = 1;
    if (!AddCandidatesOf(k)) break;
  }
  return first;
}

int PoseFinder::State::LocationOf(int k) const {
  return model.scoring().pair_location[keyframes.pair[k]];
}

// Whether a keyframe is of another location than the best pose's, and shows something else. Changes
// the candidates.
bool PoseFinder::State::IsOfAnotherPlace(int k, const FoundPose& best) {
  if (LocationOf(k) == LocationOf(best.keyframe_idx)) return false;
  ClearCandidates();
  AddCandidatesOf(best.keyframe_idx);
  return CountShared(k) * kSharedOfLandmarks < static_cast<int>(LandmarksOf(k).size());
}

void PoseFinder::State::AddMatch(const Keypoint& keypoint, std::uint32_t landmark) {
  matches.push_back({Eigen::Vector2d(double{keypoint.x}, double{keypoint.y}), SigmaOf(keypoint),
                     LandmarkPosition(model, landmark)});
  matched_landmarks.push_back(landmark);
}

// Features with candidates by descriptors alone, the most alike first.
void PoseFinder::State::MatchCandidates(const FeatureSet& features) {
  const std::size_t n = candidates.size();
  for (std::size_t c = 0; c < n; ++c) {
    const auto from = landmarks.descriptors.begin() + std::ptrdiff_t(candidates[c]) * dim;
    std::copy_n(from, dim, descriptors.begin() + std::ptrdiff_t(c) * dim);
    signs[c] = landmarks.laplacian_sign[candidates[c]];
  }
  const DescriptorSet queries = {features.descriptors(),
                                 std::span(feature_signs).first(features.size())};
  const DescriptorSet targets = {std::span(descriptors).first(n * dim), std::span(signs).first(n)};
  const Result<int> found = matcher.Match(
      queries, targets, {.max_ratio = options.max_ratio, .mutual = true}, descriptor_matches);
  const int size = found.ok() ? *found : 0;
  std::sort(descriptor_matches.begin(), descriptor_matches.begin() + size,
            [](const DescriptorMatch& a, const DescriptorMatch& b) {
              return std::pair(a.distance2, a.query_idx) < std::pair(b.distance2, b.query_idx);
            });
  matches.clear();
  matched_landmarks.clear();
  for (int i = 0; i < size; ++i) {
    const DescriptorMatch& m = descriptor_matches[i];
    AddMatch(features.keypoints()[m.query_idx], candidates[m.candidate_idx]);
  }
}

// Landmarks of the keyframes that share most with the matches in use.
void PoseFinder::State::GatherCovisible() {
  std::fill(votes.begin(), votes.end(), 0);
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (used[i] == 0) continue;
    const std::uint32_t l = matched_landmarks[i];
    for (std::uint32_t s = seen_by_begin[l]; s < seen_by_begin[l + 1]; ++s) ++votes[seen_by[s]];
  }
  ranked.clear();
  for (int k = 0; k < keyframes.size; ++k) {
    if (votes[k] > 0) ranked.emplace_back(-votes[k], k);
  }
  std::sort(ranked.begin(), ranked.end());
  ClearCandidates();
  for (std::size_t i = 0; i < ranked.size() && i < kNeighbours; ++i) {
    if (!AddCandidatesOf(ranked[i].second)) break;
  }
}

// Landmarks of the keyframes whose views are most like this one.
void PoseFinder::State::GatherNear(int map, const Rigid3& cam_from_world) {
  const Rigid3 world_from_cam = Inverse(cam_from_world);
  ranked.clear();
  for (int k = 0; k < keyframes.size; ++k) {
    const auto seen = LandmarksOf(k);
    if (seen.empty() || model.MapOf(seen.front()) != map) continue;
    const double unlike = Unlike(world_from_cam, KeyframePose(keyframes, k), PaceOf(map));
    if (unlike < kNoView) ranked.emplace_back(unlike, k);  // numbers that are none are in no order
  }
  std::sort(ranked.begin(), ranked.end());
  ClearCandidates();
  for (std::size_t i = 0; i < ranked.size() && i < kNeighbours; ++i) {
    if (!AddCandidatesOf(ranked[i].second)) break;
  }
}

// Where a landmark is in the image, or no farther than `margin_px` outside it.
bool PoseFinder::State::IsInImage(const Camera& camera, const Rigid3& cam_from_world,
                                  std::uint32_t landmark, double margin_px,
                                  Eigen::Vector2d& pixel) const {
  return camera.Project(cam_from_world * LandmarkPosition(model, landmark), pixel) &&
         pixel.x() > -margin_px && pixel.y() > -margin_px && pixel.x() < camera.width + margin_px &&
         pixel.y() < camera.height + margin_px;
}

// Calls visit(feature, squared distance in the image) for the features of a landmark's sign that
// are no farther from where it must be seen.
template <typename Visit>
void PoseFinder::State::ForEachNear(const FeatureSet& features, std::uint32_t landmark,
                                    const Eigen::Vector2d& pixel, double radius_px,
                                    const Visit& visit) const {
  grid.ForEachNear(pixel.x(), pixel.y(), radius_px, [&](int f) {
    const Keypoint& keypoint = features.keypoints()[f];
    const double dx = double{keypoint.x} - pixel.x();
    const double dy = double{keypoint.y} - pixel.y();
    const double distance2 = dx * dx + dy * dy;
    if (distance2 > radius_px * radius_px) return;
    if (keypoint.laplacian_sign == landmarks.laplacian_sign[landmark]) visit(f, distance2);
  });
}

std::int32_t PoseFinder::State::SquaredDistanceTo(const FeatureSet& features, int f,
                                                  std::uint32_t landmark) const {
  return SquaredDistance(features.descriptor(f).data(),
                         &landmarks.descriptors[std::size_t(landmark) * dim], dim);
}

// Features with candidates by place and descriptor: each candidate takes the most alike
// feature near where it must be seen, each feature its most alike candidate.
void PoseFinder::State::MatchGuided(const FeatureSet& features, const Camera& camera,
                                    const Rigid3& cam_from_world, double radius_px) {
  std::fill(landmark_of_feature.begin(), landmark_of_feature.end(), -1);
  const std::int32_t limit = options.max_guided_distance * options.max_guided_distance;
  for (const std::uint32_t l : candidates) {
    Eigen::Vector2d pixel;
    if (!IsInImage(camera, cam_from_world, l, radius_px, pixel)) continue;
    int best = -1;
    std::int32_t best_distance = limit;
    ForEachNear(features, l, pixel, radius_px, [&](int f, double) {
      const std::int32_t distance = SquaredDistanceTo(features, f, l);
      if (distance < best_distance) {
        best_distance = distance;
        best = f;
      }
    });
    if (best < 0) continue;
    if (landmark_of_feature[best] >= 0 && distance_of_feature[best] <= best_distance) continue;
    landmark_of_feature[best] = l;
    distance_of_feature[best] = best_distance;
  }
  matches.clear();
  matched_landmarks.clear();
  for (int f = 0; f < features.size(); ++f) {
    if (landmark_of_feature[f] < 0) continue;
    AddMatch(features.keypoints()[f], static_cast<std::uint32_t>(landmark_of_feature[f]));
  }
  used.assign(matches.size(), 1);
}

// Marks in `used` the matches that agree with a pose, and counts them.
int PoseFinder::State::MarkInliers(const Camera& camera, const Rigid3& cam_from_world) {
  int inliers = 0;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const PoseMatch& m = matches[i];
    Eigen::Vector2d pixel;
    const bool seen = camera.Project(cam_from_world * m.point_in_world, pixel);
    const double limit = kInlierSigma * m.sigma_px;
    used[i] = seen && (pixel - m.pixel).squaredNorm() <= limit * limit ? 1 : 0;
    inliers += used[i];
  }
  return inliers;
}

bool PoseFinder::State::Refine(const Camera& camera, const PoseRefinerOptions& refiner,
                               RefinedPose& pose) {
  const RefinedPose refined = RefinePose(camera, matches, used, pose.cam_from_world, refiner);
  if (refined.found) pose = refined;
  return refined.found;
}

// The keyframe that stands nearest of those that share most with the matches, what these say,
// and what the keyframe's landmarks would say if all were seen.
void PoseFinder::State::Describe(const Camera& camera, FoundPose& found) {
  GatherCovisible();
  if (ranked.empty()) return;
  const Rigid3 world_from_cam = Inverse(found.pose.cam_from_world);
  const double pace = PaceOf(model.MapOf(LandmarksOf(ranked.front().second).front()));
  const auto end = ranked.begin() + std::min<std::ptrdiff_t>(kNeighbours, std::ssize(ranked));
  const auto nearest = std::min_element(ranked.begin(), end, [&](const auto& a, const auto& b) {
    return Unlike(world_from_cam, KeyframePose(keyframes, a.second), pace) <
           Unlike(world_from_cam, KeyframePose(keyframes, b.second), pace);
  });
  found.keyframe_idx = nearest->second;
  found.map_idx = model.MapOf(LandmarksOf(found.keyframe_idx).front());
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (used[i] != 0) found.evidence += RarityOf(matched_landmarks[i]);
  }
  ImageParts expected = {}, agreeing = {};
  for (const std::uint32_t l : LandmarksOf(found.keyframe_idx)) {
    Eigen::Vector2d pixel;
    if (!IsInImage(camera, found.pose.cam_from_world, l, 0, pixel)) continue;
    found.expected += RarityOf(l);
    ++expected[PartOf(camera, pixel)];
  }
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (used[i] != 0) ++agreeing[PartOf(camera, matches[i].pixel)];
  }
  found.spread = SpreadOf(expected, agreeing);
}

// The matches in use, for whoever goes on with them.
void PoseFinder::State::KeepInliers() {
  kept_inliers.clear();
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (used[i] != 0) kept_inliers.push_back(matches[i]);
  }
}

// The pose that most matches agree with, however they were made.
FoundPose PoseFinder::State::FindAmongMatches(const FeatureSet& features, const Camera& camera,
                                              bool refine_focal, AbsolutePoseEstimator& by) {
  const AbsolutePose start = by.Estimate(camera, matches);
  if (!start.found) return {};
  used.assign(by.inliers().begin(), by.inliers().end());
  return Grow(features, camera, refine_focal, start.pose);
}

// Rounds of guided matching and refinement from a start: the landmarks to look for are those near
// the matches in use.
FoundPose PoseFinder::State::Grow(const FeatureSet& features, Camera camera, bool refine_focal,
                                  RefinedPose start) {
  FoundPose found;
  PoseRefinerOptions refiner;
  refiner.refine_focal = refine_focal;
  RefinedPose pose = start;
  double radius_px = options.guided_radius_px * (refine_focal ? 2 : 1);
  for (int round = 0; round < kRounds; ++round) {
    GatherCovisible();
    MatchGuided(features, camera, pose.cam_from_world, radius_px);
    if (static_cast<int>(matches.size()) < options.min_inliers) return found;
    if (!Refine(camera, refiner, pose)) return found;
    camera.fx *= pose.focal_factor;
    camera.fy *= pose.focal_factor;
    MarkInliers(camera, pose.cam_from_world);
    if (!Refine(camera, refiner, pose)) return found;
    camera.fx *= pose.focal_factor;
    camera.fy *= pose.focal_factor;
    radius_px = std::min(radius_px, kFinalRadiusSigma * 2 * double{landmarks.pixel_sigma});
  }
  found.num_inliers = MarkInliers(camera, pose.cam_from_world);
  found.pose = pose;
  found.camera = camera;
  // Sigmas that turn out too small would promise too much.
  const double excess = std::max(1.0, pose.residual_rms);
  found.pose.covariance *= excess * excess;
  Describe(camera, found);
  return found;
}

bool PoseFinder::State::Convincing(const FoundPose& found, int min_inliers) const {
  return found.num_inliers >= min_inliers && found.evidence >= options.min_evidence &&
         found.evidence >= options.min_evidence_share * found.expected;
}

bool PoseFinder::State::StandsElsewhere(const FoundPose& pose, int map_idx,
                                        const Rigid3& cam_from_world) const {
  return pose.map_idx != map_idx ||
         Unlike(Inverse(pose.pose.cam_from_world), Inverse(cam_from_world), PaceOf(map_idx)) > 1;
}

Likeness PoseFinder::State::LikenessOf(const FeatureSet& features, int f,
                                       std::uint32_t landmark) const {
  const auto length = [](std::int32_t squared) { return std::sqrt(static_cast<float>(squared)); };
  Likeness likeness;
  likeness.distance = length(SquaredDistanceTo(features, f, landmark));
  if (!features.has_chroma() || landmarks.chroma.empty()) return likeness;
  const auto steps = landmarks.chroma.subspan(std::size_t(landmark) * kChromaDim, kChromaDim);
  if (steps[0] == kNoLandmarkChroma) return likeness;
  std::int32_t sum = 0;
  for (int i = 0; i < kChromaDim; ++i) {
    const std::int32_t difference =
        features.chroma()[std::size_t(f) * kChromaDim + i] - kLandmarkChromaStep * steps[i];
    sum += difference * difference;
  }
  likeness.chroma_distance = length(sum);
  return likeness;
}

// Each feature with the most alike of the landmarks that a pose puts where it is.
void PoseFinder::State::Compare(const FeatureSet& features, const FoundPose& found,
                                std::vector<Likeness>& likeness) {
  GatherNear(found.map_idx, found.pose.cam_from_world);
  std::fill_n(likeness.begin(), features.size(), Likeness());
  for (const std::uint32_t l : candidates) {
    Eigen::Vector2d pixel;
    if (!IsInImage(found.camera, found.pose.cam_from_world, l, 0, pixel)) continue;
    ForEachNear(features, l, pixel, options.guided_radius_px, [&](int f, double distance2) {
      const double limit = kInlierSigma * SigmaOf(features.keypoints()[f]);
      if (distance2 > limit * limit) return;
      const Likeness here = LikenessOf(features, f, l);
      if (likeness[f].distance < 0 || here.distance < likeness[f].distance) likeness[f] = here;
    });
  }
}

// The factor by which the frame's features favour a pose over the best one, elsewhere. Of
// look-alike places, the one whose map is the fuller has more evidence, wherever the frame is; what
// is on both maps tells them apart.
float PoseFinder::State::FavourOf(const FeatureSet& features, const FoundPose& found,
                                  const FoundPose& best) {
  if (!is_best_compared) Compare(features, best, likeness_of_best);
  is_best_compared = true;
  Compare(features, found, likeness_of_other);
  float favour = 0;
  for (int f = 0; f < features.size(); ++f) {
    favour += SaidFor(likeness_of_other[f], likeness_of_best[f]);
  }
  return static_cast<float>(Exp(double{std::clamp(favour, -kMostFavour, kMostFavour)}));
}

// Keeps the pose that more speaks for; the other is its rival if it stands elsewhere, with the
// evidence that it has once the features that favour either are counted. One that does not convince
// takes no place of one that does.
bool PoseFinder::State::TakeIfBetter(const FeatureSet& features, const FoundPose& found,
                                     FoundPose& best) {
  const bool elsewhere =
      best.evidence > 0 && StandsElsewhere(found, best.map_idx, best.pose.cam_from_world);
  const bool compared = elsewhere && std::min(found.evidence, best.evidence) >
                                         kWorthComparing * std::max(found.evidence, best.evidence);
  const float favour = compared ? FavourOf(features, found, best) : 1;
  const bool allowed =
      Convincing(found, options.min_inliers) || !Convincing(best, options.min_inliers);
  const bool better = allowed && found.evidence * favour > best.evidence;
  const FoundPose other = better ? best : found;
  if (better) {
    best = found;
    std::swap(likeness_of_best, likeness_of_other);
    is_best_compared = compared;
  }
  const float of_best =
      better ? 1 / favour : 1;  // those of the best so far were compared with that
  const auto take = [&](PoseRival rival) {
    if (!StandsElsewhere(best, rival.map_idx, rival.cam_from_world)) return;
    for (PoseRival& place : best.rivals) {
      if (rival.evidence > place.evidence) std::swap(rival, place);
    }
  };
  if (elsewhere) {
    const float evidence = other.evidence * (better ? of_best : favour);
    take({std::min(evidence, best.evidence), other.keyframe_idx, other.map_idx,
          other.pose.cam_from_world});
  }
  for (PoseRival rival : other.rivals) {
    rival.evidence *= of_best;
    if (rival.evidence > 0) take(rival);
  }
  return better;
}

// The pose that the candidates give, if it is better than the best so far.
void PoseFinder::State::TryCandidates(const FeatureSet& features, const Camera& camera,
                                      bool refine_focal, FoundPose& best) {
  MatchCandidates(features);
  const FoundPose found = FindAmongMatches(features, camera, refine_focal, estimator);
  if (found.evidence > 0 && TakeIfBetter(features, found, best)) KeepInliers();
}

// Scores may be sure of one of two look-alike places: the other has its say.
void PoseFinder::State::TryLookAlike(const FeatureSet& features, const Camera& camera,
                                     bool refine_focal,
                                     std::span<const ProposedKeyframe> look_alikes,
                                     FoundPose& best) {
  if (best.keyframe_idx < 0) return;
  for (std::size_t i = 0; i < look_alikes.size(); ++i) {
    const int k = look_alikes[i].keyframe_idx;
    if (!IsOfAnotherPlace(k, best)) continue;
    const bool compared = std::ranges::any_of(best.rivals, [&](const PoseRival& rival) {
      return rival.keyframe_idx >= 0 && LocationOf(rival.keyframe_idx) == LocationOf(k);
    });
    if (!compared && tried[k] == 0 && GatherGroup(look_alikes.subspan(i)) != nullptr) {
      TryCandidates(features, camera, refine_focal, best);
    }
    return;
  }
}

PoseFinder::PoseFinder(std::unique_ptr<State> state) : state_(std::move(state)) {}
PoseFinder::PoseFinder(PoseFinder&&) noexcept = default;
PoseFinder& PoseFinder::operator=(PoseFinder&&) noexcept = default;
PoseFinder::~PoseFinder() = default;

Result<PoseFinder> PoseFinder::Create(const ModelView& model, const PoseFinderOptions& options) {
  if (Status status = options.Validate(); !status.ok()) return status;
  if (!model.has_landmarks()) return Status(StatusCode::kInvalidArgument, "model has no landmarks");
  AbsolutePoseOptions pose;
  pose.capacity = std::max(3, model.features().max_features);
  pose.max_iterations = 2000;
  pose.min_inliers = kMinStart;
  auto estimator = AbsolutePoseEstimator::Create(pose);
  if (!estimator.ok()) return estimator.status();
  pose.max_iterations = kTrackingIterations;
  auto tracker = AbsolutePoseEstimator::Create(pose);
  if (!tracker.ok()) return tracker.status();
  return PoseFinder(
      std::make_unique<State>(model, options, std::move(*estimator), std::move(*tracker)));
}

FoundPose PoseFinder::Find(const FeatureSet& features, const Camera& camera, bool refine_focal,
                           std::span<const ProposedKeyframe> proposed,
                           std::span<const ProposedKeyframe> look_alikes) {
  State& s = *state_;
  s.StartFrame(features);
  FoundPose best;
  for (int group = 0; group < s.options.max_groups; ++group) {
    const ProposedKeyframe* first = s.GatherGroup(proposed);
    if (first == nullptr) break;
    const bool certain = best.num_inliers >= kCertainTimes * s.options.min_inliers;
    if (certain && first->promise < proposed.front().promise - s.options.rival_promise) break;
    s.TryCandidates(features, camera, refine_focal, best);
  }
  s.TryLookAlike(features, camera, refine_focal, look_alikes, best);
  best.found = s.Convincing(best, s.options.min_inliers);
  return best;
}

FoundPose PoseFinder::FindNear(const FeatureSet& features, const Camera& camera, bool refine_focal,
                               int map_idx, const Rigid3& cam_from_world) {
  State& s = *state_;
  s.StartFrame(features);
  s.GatherNear(map_idx, cam_from_world);
  s.MatchGuided(features, camera, cam_from_world, s.options.tracking_radius_px);
  // Where the prediction is poor, most matches are wrong: they have to agree on a pose, as those
  // of a frame alone have to.
  FoundPose found = s.FindAmongMatches(features, camera, refine_focal, s.tracker);
  found.found = s.Convincing(found, 2 * s.options.min_inliers) &&
                found.evidence >= s.options.min_tracked_share * found.expected;
  if (found.found) s.KeepInliers();
  return found;
}

std::span<const PoseMatch> PoseFinder::inliers() const { return state_->kept_inliers; }

}  // namespace viewfix
