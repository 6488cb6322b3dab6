// SPDX-License-Identifier: BSD-3-Clause
#include "engine/localizer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "engine/base/exp.h"
#include "engine/base/location_name.h"
#include "engine/image/image_quality.h"
#include "engine/image/resize.h"
#include "engine/matching/place_evidence.h"
#include "engine/pose/model_geometry.h"
#include "engine/pose/pose_confidence.h"
#include "engine/pose/window_adjuster.h"
#include "engine/retrieval/retrieval.h"
#include "engine/scoring/scoring.h"
#include "engine/vocabulary/vocabulary.h"

namespace viewfix {
namespace {

Status CheckExtractor(const ModelFeatures& model, const FeatureExtractor& extractor) {
  if (extractor.version() != model.version || extractor.descriptor_dim() != model.descriptor_dim) {
    return {StatusCode::kUnsupported,
            "model was trained with features that this program cannot reproduce; train it again"};
  }
  return {};
}

Status CheckImage(const ImageView& image) {
  if (image.empty() || image.row_bytes < image.width) {
    return {StatusCode::kInvalidArgument, "image is empty"};
  }
  if (image.width > kMaxImageSide || image.height > kMaxImageSide ||
      std::int64_t{image.width} * image.height > kMaxImagePixels) {
    return {StatusCode::kInvalidArgument, "image is too large"};
  }
  const ChromaView& chroma = image.chroma;
  if (!chroma.empty() && (chroma.width > kMaxImageSide || chroma.height > kMaxImageSide ||
                          chroma.row_bytes < chroma.width)) {
    return {StatusCode::kInvalidArgument, "chroma has no size that fits"};
  }
  return {};
}

// Keyframes whose landmarks a frame is matched with: those of the first few places that the
// scores name.
constexpr int kPromisingKeyframes = 24;
constexpr int kPromisingOfLocation = 8;
constexpr int kPromisingOfPair = 4;

// The locations whose most similar keyframe is so little less similar than the most similar of all
// (retrieval.h) may be what the frame shows, whatever the scores say: so many keyframes of each.
constexpr float kLessSimilar = 0.075F;
constexpr int kLookAlikesOfLocation = 4;

bool MorePromising(const ProposedKeyframe& a, const ProposedKeyframe& b) {
  return a.promise != b.promise ? a.promise > b.promise : a.keyframe_idx < b.keyframe_idx;
}

// A pose elsewhere that more than this share of the evidence speaks for leaves a doubt.
constexpr float kAmbiguousShare = 0.7F;
static_assert(FoundPose::kMaxRivals <= Fix::kMaxRivals);

// A location that this share of the best one's evidence speaks for is its rival.
constexpr float kRivalShare = 0.65F;

// Of a pose, where the model has no curve of what speaks for right ones: so many agreeing landmarks
// are as often wrong as right, and it is believed if they say so much and have such a share of what
// should be seen (FoundPose).
constexpr float kDoubtfulInliers = 3;
constexpr float kLeastEvidence = 10;
constexpr float kLeastEvidenceShare = 0.15F;

float Milliseconds(std::int64_t nanoseconds) { return static_cast<float>(nanoseconds) * 1e-6F; }

// Images of the same shape: their sides have one ratio, to the rounding of a resize.
bool SameShape(const Camera& camera, int width, int height) {
  const double expected = static_cast<double>(camera.height) * width / camera.width;
  return std::abs(expected - height) <= 0.01 * height + 1;
}

// A rotation and a place that squared distances can be made from.
bool IsPose(const Rigid3& pose) {
  const double norm2 = pose.rotation.squaredNorm();
  return pose.translation.cwiseAbs().maxCoeff() < 1e12 && pose.translation.allFinite() &&
         norm2 > 0.999 && norm2 < 1.001;
}

Status CheckPrior(const Prior& prior, const ImageView& image) {
  if (prior.cam_from_world != nullptr && !IsPose(*prior.cam_from_world)) {
    return {StatusCode::kInvalidArgument, "the pose expected is none"};
  }
  if (prior.camera == nullptr) return {};
  if (Status status = prior.camera->Validate(); !status.ok()) return status;
  if (!SameShape(*prior.camera, image.width, image.height)) {
    return {StatusCode::kInvalidArgument, "image and camera calibration differ in shape"};
  }
  return {};
}

// A camera of whose lens nothing is known, with the focal length, by its longer side, of another.
Camera GuessCamera(const Camera& like, int width, int height) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = like.fx * std::max(width, height) / std::max(like.width, like.height);
  camera.fy = camera.fx;
  camera.cx = 0.5 * (width - 1);
  camera.cy = 0.5 * (height - 1);
  return camera;
}

// Nothing where none is asked for.
Result<std::optional<WindowAdjuster>> MakeWindow(const ModelView& model,
                                                 const LocalizerOptions& options) {
  if (options.window == 0) return std::optional<WindowAdjuster>();
  if (!(options.frame_interval_s > 0)) {
    return Status(StatusCode::kInvalidArgument, "frame_interval_s is not positive");
  }
  WindowAdjusterOptions window;
  window.max_frames = options.window;
  window.capacity = model.features().max_features;
  auto created = WindowAdjuster::Create(window);
  if (!created.ok()) return created.status();
  return std::optional<WindowAdjuster>(std::move(*created));
}

bool HasLandmarks(const ModelKeyframes& keyframes, int k) {
  return keyframes.landmark_begin[k] < keyframes.landmark_begin[std::size_t(k) + 1];
}

// What the image itself has against being recognized.
std::uint32_t ImageReasons(const ImageView& image) {
  const ImageQuality quality = MeasureQuality(image);
  return (quality.blurred() ? kBlurred : 0U) | (quality.dark() ? kDark : 0U) |
         (quality.overexposed() ? kOverexposed : 0U);
}

}  // namespace

FeatureOptions FeatureOptionsOf(const ModelFeatures& features) {
  return {.type = static_cast<FeatureType>(features.type),
          .max_image_side = features.max_image_side,
          .max_features = features.max_features,
          .upright = features.upright,
          .threshold = features.threshold};
}

const char* ReasonName(Reason reason) {
  switch (reason) {
    case kTooFewFeatures:
      return "too_few_features";
    case kUnknownPlace:
      return "unknown_place";
    case kAmbiguous:
      return "ambiguous";
    case kLowInliers:
      return "low_inliers";
    case kBlurred:
      return "blurred";
    case kDark:
      return "dark";
    case kOverexposed:
      return "overexposed";
  }
  return "";
}

struct Localizer::State {
  State(const ModelView& model_view, const LocalizerOptions& localizer_options,
        std::unique_ptr<FeatureExtractor> feature_extractor, std::optional<PoseFinder> finder,
        std::optional<WindowAdjuster> window_adjuster)
      : model(model_view),
        options(localizer_options),
        extractor(std::move(feature_extractor)),
        shrink(model.features().max_image_side),
        features(model.features().max_features, model.features().descriptor_dim),
        vocabulary(model.vocabulary().words, model.vocabulary().dim),
        words(std::size_t(model.features().max_features) * model.vocabulary().words_per_feature),
        histogram_builder(vocabulary.size(), model.features().max_features,
                          model.vocabulary().words_per_feature, model.scoring().histogram_map),
        histogram(histogram_builder.MakeHistogram()),
        pair_scores(model.scoring().num_pairs),
        pair_evidence(model.scoring().num_pairs),
        location_scores(model.scoring().num_locations),
        retrieval(model.keyframes(), model.scoring().histogram_map, vocabulary.size(),
                  model.scoring().num_pairs),
        keyframe_similarities(model.keyframes().size),
        model_camera(CameraOf(model.camera())),
        pose_finder(std::move(finder)),
        window(std::move(window_adjuster)) {
    if (pose_finder) FindMapped();
    if (model.has_details()) {
      places.emplace(model.vocabulary().words, model.vocabulary().dim, model.details(),
                     model.scoring().num_locations, features.capacity());
      likeness.resize(model.scoring().num_locations);
      place_scores.resize(model.scoring().num_locations);
    }
    all_proposed.reserve(model.keyframes().size);
    proposed.reserve(kPromisingKeyframes);
    look_alikes.reserve(model.keyframes().size);
    proposed_of_location.resize(model.scoring().num_locations);
    proposed_of_pair.resize(model.scoring().num_pairs);
    seen_points.reserve(features.capacity());
  }

  std::int64_t Now() const { return options.now_ns == nullptr ? 0 : options.now_ns(); }

  void FindMapped();
  int NearestKeyframe(int pair_idx) const;
  int BestOtherLocation(const Fix& fix) const;
  void Score(Fix& fix);
  void FindRivals(Fix& fix) const;
  void Decide(int close_votes, Fix& fix) const;
  float ConfidenceOf(float margin, int close_votes) const;
  std::optional<float> MarginAtLevel(const Fix& fix, int level) const;
  bool DecideAtLevel(int close_votes, Fix& fix) const;
  std::span<const ProposedKeyframe> PromisingKeyframes();
  std::span<const ProposedKeyframe> LookAlikes();
  void ChooseCamera(const Prior& prior, int width, int height);
  bool Track(const Prior& prior, Fix& fix);
  void FindPose(const Prior& prior, Fix& fix);
  float PoseConfidenceOf(const FoundPose& found) const;
  bool Believed(const FoundPose& found) const;
  void TakePose(const FoundPose& found, Fix& fix) const;
  void GuessPlace(const FoundPose& found, Fix& fix) const;
  void ScoreGuess(Fix& fix) const;
  bool WantsLandmarks(const Fix& fix) const;
  void AdjustWindow(const FoundPose& found, std::uint64_t sequence, Fix& fix);
  void SayWhatRivalsShare(const FoundPose& found, Fix& fix) const;
  void LocateByScore(Fix& fix) const;
  void LocateByDetails(Fix& fix);
  void FindDetailRivals(Fix& fix) const;
  void ClearScores();
  bool Matched(int i) const;

  ModelView model;
  LocalizerOptions options;
  std::unique_ptr<FeatureExtractor> extractor;
  Shrinker shrink;
  FeatureSet features;
  Vocabulary vocabulary;
  std::vector<std::uint16_t> words;
  HistogramBuilder histogram_builder;
  Histogram histogram;
  std::vector<float> pair_scores;
  std::vector<float> pair_evidence;  // the scores and what the keyframes add
  std::vector<float> location_scores;
  Retrieval retrieval;
  std::vector<float> keyframe_similarities;
  Camera model_camera;
  std::optional<PoseFinder> pose_finder;       // where the model has landmarks
  std::optional<PlaceEvidence> places;         // where the model has details
  std::vector<float> likeness;                 // [locations] with details
  std::vector<float> place_scores;             // [locations] with details
  std::vector<ProposedKeyframe> all_proposed;  // [keyframes]
  std::vector<ProposedKeyframe> proposed;
  std::vector<ProposedKeyframe> look_alikes;
  std::vector<std::uint8_t> is_mapped;  // [locations] at least half of the keyframes have landmarks
  std::vector<int> proposed_of_location;  // [locations]
  std::vector<int> proposed_of_pair;      // [pairs]
  std::optional<WindowAdjuster> window;   // where asked for
  int window_map = -1;                    // that its frames are in
  // Of the frame at hand, at the size that features are found in.
  Camera camera;
  bool refine_focal = false;
  // Of the last frame, for SeenPoints().
  std::vector<SeenPoint> seen_points;
  float columns_per_column = 1, rows_per_row = 1;  // of the image given, per one of the small one
  bool last_has_pose = false;
  int last_place = -1;  // that details spoke for; -1: they were not asked, or spoke for none
};

void Localizer::State::FindMapped() {
  const ModelKeyframes& keyframes = model.keyframes();
  std::vector<int> all(model.scoring().num_locations, 0), mapped = all;
  for (int k = 0; k < keyframes.size; ++k) {
    const int location = model.scoring().pair_location[keyframes.pair[k]];
    ++all[location];
    if (HasLandmarks(keyframes, k)) ++mapped[location];
  }
  for (std::size_t l = 0; l < all.size(); ++l) {
    is_mapped.push_back(mapped[l] > 0 && 2 * mapped[l] >= all[l] ? 1 : 0);
  }
}

// Equation (5) and the keyframes' similarities, then the location by the model's rule, its
// best view, and the nearest keyframe inside that pair (section 2 of the method).
void Localizer::State::Score(Fix& fix) {
  const int per_feature = model.vocabulary().words_per_feature;
  const std::span<std::uint16_t> found(words.data(), std::size_t(features.size()) * per_feature);
  vocabulary.NearestWords(features.descriptors(), per_feature, found);
  histogram_builder.Build(found, histogram);
  ScorePairs(model.scoring(), histogram, pair_scores);
  retrieval.SetQuery(histogram);
  retrieval.Similarities(keyframe_similarities);
  pair_evidence = pair_scores;
  AddKeyframeSimilarity(model.scoring(), model.keyframes(), keyframe_similarities, pair_evidence);
  ScoreLocations(model.scoring(), pair_evidence, location_scores);
  const auto best = std::max_element(location_scores.begin(), location_scores.end());
  fix.location_idx = static_cast<int>(best - location_scores.begin());
  fix.pair_idx = BestPairOf(model.scoring(), pair_evidence, fix.location_idx);
  fix.score = pair_scores[fix.pair_idx];
  fix.keyframe_idx = NearestKeyframe(fix.pair_idx);
}

// The most similar keyframe of a pair, the lowest index among equals; -1: it has none.
int Localizer::State::NearestKeyframe(int pair_idx) const {
  const int first = retrieval.FirstOf(pair_idx);
  const int last = retrieval.LastOf(pair_idx);
  if (first == last) return -1;
  const auto begin = keyframe_similarities.begin();
  return static_cast<int>(std::max_element(begin + first, begin + last) - begin);
}

// The best location that is neither the guess nor a rival already; -1: none is left.
int Localizer::State::BestOtherLocation(const Fix& fix) const {
  const int* const rivals_end = fix.rivals + fix.num_rivals;
  int best = -1;
  for (int l = 0; l < static_cast<int>(location_scores.size()); ++l) {
    if (l == fix.location_idx || std::find(fix.rivals, rivals_end, l) != rivals_end) continue;
    if (best < 0 || location_scores[l] > location_scores[best]) best = l;
  }
  return best;
}

void Localizer::State::FindRivals(Fix& fix) const {
  fix.num_rivals = 0;
  int other = BestOtherLocation(fix);
  if (other < 0) return;
  const float best_score = location_scores[fix.location_idx];
  fix.margin = best_score - location_scores[other];
  while (other >= 0 && fix.num_rivals < Fix::kMaxRivals &&
         best_score - location_scores[other] <= options.rival_margin) {
    fix.rivals[fix.num_rivals++] = other;
    other = BestOtherLocation(fix);
  }
}

//   close_votes  for the guess, where details give them (matching/place_evidence.h)
float Localizer::State::ConfidenceOf(float margin, int close_votes) const {
  const ModelConfidence& curve = model.confidence();
  const float lead = LeadOf(margin, close_votes, model.details().close_weight);
  return static_cast<float>(1.0 /
                            (1.0 + Exp(-(double{curve.offset} + double{curve.slope} * lead))));
}

// The best guess's score less that of the best location that differs from it in the first `level`
// parts of its name; none if all begin with them, for then they say nothing.
std::optional<float> Localizer::State::MarginAtLevel(const Fix& fix, int level) const {
  const std::span<const float> scores = places ? place_scores : location_scores;
  const std::string_view said = UpToLevel(model.location_name(fix.location_idx), level);
  std::optional<float> best_other;
  for (int l = 0; l < static_cast<int>(scores.size()); ++l) {
    if (UpToLevel(model.location_name(l), level) == said) continue;
    best_other = std::max(best_other.value_or(scores[l]), scores[l]);
  }
  if (!best_other) return std::nullopt;
  return scores[fix.location_idx] - *best_other;
}

// Where areas of one floor look alike, but like those of no other floor, the floor is answered. The
// close details are still the area's: what all areas of a large floor have together says little.
bool Localizer::State::DecideAtLevel(int close_votes, Fix& fix) const {
  for (int level = LevelsOf(model.location_name(fix.location_idx)) - 1; level > 0; --level) {
    const std::optional<float> margin = MarginAtLevel(fix, level);
    if (!margin) continue;
    const float confidence = ConfidenceOf(*margin, close_votes);
    if (!(confidence >= model.confidence().threshold)) continue;
    fix.level = level;
    fix.confidence = confidence;
    return true;
  }
  return false;
}

void Localizer::State::Decide(int close_votes, Fix& fix) const {
  fix.confidence = ConfidenceOf(fix.margin, close_votes);
  fix.localized = fix.confidence >= model.confidence().threshold;
  if (fix.localized) return;
  fix.reasons |= fix.num_rivals > 0 ? kAmbiguous : kUnknownPlace;
  if (fix.num_rivals > 0) fix.localized = DecideAtLevel(close_votes, fix);
}

// Keyframes by their pair's score and their own similarity, best first: the rule that chooses
// the location, applied to each. No location or view of it takes all the places, so that a
// look-alike one has its say.
std::span<const ProposedKeyframe> Localizer::State::PromisingKeyframes() {
  const float weight = model.scoring().keyframe_weight;
  const auto& pair_of = model.keyframes().pair;
  all_proposed.clear();
  for (int k = 0; k < model.keyframes().size; ++k) {
    const float promise = pair_scores[pair_of[k]] + weight * keyframe_similarities[k];
    // What is not a number is in no order.
    all_proposed.push_back(
        {k, std::isnan(promise) ? -std::numeric_limits<float>::infinity() : promise});
  }
  std::sort(all_proposed.begin(), all_proposed.end(), MorePromising);
  std::fill(proposed_of_pair.begin(), proposed_of_pair.end(), 0);
  std::fill(proposed_of_location.begin(), proposed_of_location.end(), 0);
  proposed.clear();
  for (const ProposedKeyframe& p : all_proposed) {
    const int pair = pair_of[p.keyframe_idx];
    int& of_location = proposed_of_location[model.scoring().pair_location[pair]];
    if (of_location == kPromisingOfLocation || proposed_of_pair[pair] == kPromisingOfPair) continue;
    ++of_location;
    ++proposed_of_pair[pair];
    proposed.push_back(p);
    if (std::ssize(proposed) == kPromisingKeyframes) break;
  }
  return proposed;
}

// The most similar keyframes of each location that is like the frame, most similar first.
std::span<const ProposedKeyframe> Localizer::State::LookAlikes() {
  const auto& pair_of = model.keyframes().pair;
  all_proposed.clear();
  for (int k = 0; k < model.keyframes().size; ++k) {
    const float similarity = keyframe_similarities[k];
    if (HasLandmarks(model.keyframes(), k) && !std::isnan(similarity)) {
      all_proposed.push_back({k, similarity});
    }
  }
  std::sort(all_proposed.begin(), all_proposed.end(), MorePromising);
  std::fill(proposed_of_location.begin(), proposed_of_location.end(), 0);
  look_alikes.clear();
  for (const ProposedKeyframe& p : all_proposed) {
    int& of_location = proposed_of_location[model.scoring().pair_location[pair_of[p.keyframe_idx]]];
    const bool near = p.promise >= all_proposed.front().promise - kLessSimilar;
    if (of_location == kLookAlikesOfLocation || (of_location == 0 && !near)) continue;
    ++of_location;
    look_alikes.push_back(p);
  }
  return look_alikes;
}

void Localizer::State::ChooseCamera(const Prior& prior, int width, int height) {
  if (!pose_finder) return;
  const Camera& known = prior.camera != nullptr ? *prior.camera : model_camera;
  refine_focal = !SameShape(known, width, height);
  camera = refine_focal ? GuessCamera(known, width, height) : known.ResizedTo(width, height);
}

float Localizer::State::PoseConfidenceOf(const FoundPose& found) const {
  const auto inliers = static_cast<float>(found.num_inliers);
  if (!model.pose_confidence()) return inliers / (inliers + kDoubtfulInliers);
  return PoseConfidence(*model.pose_confidence(), PoseCuesOf(found.num_inliers, found.evidence,
                                                             found.expected, found.spread));
}

bool Localizer::State::Believed(const FoundPose& found) const {
  if (!found.found) return false;
  if (!model.pose_confidence()) {
    return found.evidence >= kLeastEvidence &&
           found.evidence >= kLeastEvidenceShare * found.expected;
  }
  return PoseConfidenceOf(found) >= model.pose_confidence()->threshold;
}

void Localizer::State::TakePose(const FoundPose& found, Fix& fix) const {
  fix.localized = true;
  fix.level = 0;
  fix.has_pose = true;
  fix.map_idx = found.map_idx;
  fix.world_from_cam = Inverse(found.pose.cam_from_world);
  fix.covariance = found.pose.covariance;
  fix.num_inliers = found.num_inliers;
  fix.evidence = found.evidence;
  fix.expected_evidence = found.expected;
  fix.evidence_spread = found.spread;
  fix.rival_evidence = found.rivals[0].evidence;
  GuessPlace(found, fix);
  fix.confidence = PoseConfidenceOf(found);
}

void Localizer::State::GuessPlace(const FoundPose& found, Fix& fix) const {
  fix.keyframe_idx = found.keyframe_idx;
  fix.pair_idx = model.keyframes().pair[found.keyframe_idx];
  fix.location_idx = model.scoring().pair_location[fix.pair_idx];
}

// What the scores say of the place that the landmarks name.
void Localizer::State::ScoreGuess(Fix& fix) const {
  fix.score = pair_scores[fix.pair_idx];
  FindRivals(fix);
}

// The pose as the frames before it see it too. How a camera moves is known in metres only.
void Localizer::State::AdjustWindow(const FoundPose& found, std::uint64_t sequence, Fix& fix) {
  if (!window || !model.metric(found.map_idx)) return;
  if (found.map_idx != window_map) window->Clear();
  window_map = found.map_idx;
  const double time_s = static_cast<double>(sequence) * options.frame_interval_s;
  const AdjustedPose adjusted =
      window->Push(time_s, found.camera, pose_finder->inliers(), found.pose.cam_from_world);
  if (!adjusted.found) return;
  fix.world_from_cam = Inverse(adjusted.cam_from_world);
  // As of a single frame: sigmas that turn out too small would promise too much.
  const double excess = std::max(1.0, found.pose.residual_rms);
  fix.covariance = excess * excess * adjusted.covariance;
}

// Several places agree with the frame about as well: no more is said than the parts of the name
// that they share, all of it if they are of one location; and neither a view nor a pose. Nothing,
// if the best would not be believed if it were alone.
void Localizer::State::SayWhatRivalsShare(const FoundPose& found, Fix& fix) const {
  const std::string_view name = model.location_name(fix.location_idx);
  fix.level = LevelsOf(name);
  fix.num_rivals = 0;
  for (const PoseRival& rival : found.rivals) {
    if (!(rival.evidence > kAmbiguousShare * found.evidence)) break;
    const int location = model.scoring().pair_location[model.keyframes().pair[rival.keyframe_idx]];
    const std::span<const int> named(fix.rivals, fix.num_rivals);
    if (location == fix.location_idx) continue;
    if (std::find(named.begin(), named.end(), location) != named.end()) continue;
    fix.rivals[fix.num_rivals++] = location;
    fix.level = std::min(fix.level, CommonLevels(name, model.location_name(location)));
  }
  if (!Believed(found)) fix.level = 0;
  fix.localized = fix.level > 0;
  fix.has_pose = false;
  fix.map_idx = -1;
  fix.world_from_cam = {};
  fix.covariance.setZero();
  fix.reasons |= kAmbiguous;
  if (!fix.localized) fix.confidence = std::min(fix.confidence, 0.5F);
}

// Whether the frame was found where it was expected.
bool Localizer::State::Track(const Prior& prior, Fix& fix) {
  if (!pose_finder || prior.cam_from_world == nullptr) return false;
  const FoundPose found =
      pose_finder->FindNear(features, camera, refine_focal, prior.map_idx, *prior.cam_from_world);
  if (!Believed(found)) return false;
  ClearScores();
  TakePose(found, fix);
  fix.tracked = true;
  AdjustWindow(found, prior.sequence, fix);
  return true;
}

// Whether a frame of the place that the scores name should agree with landmarks: those of the
// nearest keyframe, or of most others.
bool Localizer::State::WantsLandmarks(const Fix& fix) const {
  return is_mapped[fix.location_idx] != 0 ||
         (fix.keyframe_idx >= 0 && HasLandmarks(model.keyframes(), fix.keyframe_idx));
}

// A pose that is believed decides. Without one, the scores' word stands where they name a place of
// which few photographs are in a map.
void Localizer::State::FindPose(const Prior& prior, Fix& fix) {
  const auto promising = PromisingKeyframes();
  const FoundPose found =
      pose_finder->Find(features, camera, refine_focal, promising, LookAlikes());
  const bool doubtful = found.rivals[0].evidence > kAmbiguousShare * found.evidence;
  const bool believed = Believed(found);
  const bool scores_stand = !believed && !WantsLandmarks(fix);
  if (believed || (found.found && doubtful && !scores_stand)) {
    TakePose(found, fix);
    fix.reasons = 0;
    ScoreGuess(fix);
    if (doubtful) {
      SayWhatRivalsShare(found, fix);
    } else {
      AdjustWindow(found, prior.sequence, fix);
    }
    return;
  }
  fix.num_inliers = found.num_inliers;
  fix.evidence = found.evidence;
  fix.expected_evidence = found.expected;
  fix.evidence_spread = found.spread;
  if (scores_stand) return;
  if (found.found) {  // not believed, but the best guess there is
    GuessPlace(found, fix);
    ScoreGuess(fix);
  }
  fix.localized = false;
  fix.level = 0;
  fix.reasons |= kLowInliers;
  fix.confidence = std::min(fix.confidence, PoseConfidenceOf(found));
}

void Localizer::State::LocateByScore(Fix& fix) const {
  FindRivals(fix);
  Decide(0, fix);
}

// Other locations that details speak for nearly as much, best first.
void Localizer::State::FindDetailRivals(Fix& fix) const {
  const auto evidence = places->evidence();
  fix.num_rivals = 0;
  while (fix.num_rivals < Fix::kMaxRivals) {
    const std::span<const int> rivals(fix.rivals, fix.num_rivals);
    int best = -1;
    for (int l = 0; l < static_cast<int>(evidence.size()); ++l) {
      if (l == fix.location_idx || std::ranges::find(rivals, l) != rivals.end()) continue;
      if (best < 0 || evidence[l] > evidence[best]) best = l;
    }
    if (best < 0) return;
    if (fix.num_rivals == 0) fix.rival_evidence = evidence[best];
    if (!(evidence[best] > kRivalShare * fix.evidence)) return;
    fix.rivals[fix.num_rivals++] = best;
  }
}

// What tells look-alike places apart decides which it is; the scores name its view.
void Localizer::State::LocateByDetails(Fix& fix) {
  const int per_feature = model.vocabulary().words_per_feature;
  places->Weigh(features.descriptors(), features.keypoints(),
                {words.data(), std::size_t(features.size()) * per_feature}, per_feature);
  LikenessOfLocations(model.scoring(), model.keyframes(), keyframe_similarities, likeness);
  ScorePlaces(places->evidence(), likeness, model.details().likeness_weight, place_scores);
  const BestPlace best = FindBestPlace(places->evidence(), place_scores);
  int close_votes = 0;
  last_place = best.location_idx;
  fix.margin = best.margin;
  if (best.location_idx >= 0) {
    fix.location_idx = best.location_idx;
    fix.pair_idx = BestPairOf(model.scoring(), pair_evidence, fix.location_idx);
    fix.score = pair_scores[fix.pair_idx];
    fix.keyframe_idx = NearestKeyframe(fix.pair_idx);
    fix.num_inliers = places->votes()[fix.location_idx];
    close_votes = places->close_votes()[fix.location_idx];
    fix.evidence = places->evidence()[fix.location_idx];
    FindDetailRivals(fix);
  }
  Decide(close_votes, fix);
  if (!fix.localized && fix.num_rivals == 0) fix.reasons |= kLowInliers;
}

void Localizer::State::ClearScores() {
  std::fill(pair_scores.begin(), pair_scores.end(), 0.0F);
  std::fill(location_scores.begin(), location_scores.end(), 0.0F);
  std::fill(keyframe_similarities.begin(), keyframe_similarities.end(), 0.0F);
}

Localizer::Localizer(std::unique_ptr<State> state) : state_(std::move(state)) {}
Localizer::Localizer(Localizer&&) noexcept = default;
Localizer& Localizer::operator=(Localizer&&) noexcept = default;
Localizer::~Localizer() = default;

Result<Localizer> Localizer::Create(const ModelView& model, const LocalizerOptions& options,
                                    std::unique_ptr<FeatureExtractor> extractor) {
  if (extractor == nullptr) {
    auto created = CreateFeatureExtractor(FeatureOptionsOf(model.features()));
    if (!created.ok()) return created.status();
    extractor = std::move(*created);
  }
  if (Status status = CheckExtractor(model.features(), *extractor); !status.ok()) return status;
  std::optional<PoseFinder> finder;
  if (model.has_landmarks()) {
    if (Status status = CameraOf(model.camera()).Validate(); !status.ok()) return status;
    auto created = PoseFinder::Create(model, options.pose);
    if (!created.ok()) return created.status();
    finder.emplace(std::move(*created));
  }
  auto window = MakeWindow(model, options);
  if (!window.ok()) return window.status();
  return Localizer(std::make_unique<State>(model, options, std::move(extractor), std::move(finder),
                                           std::move(*window)));
}

Result<Fix> Localizer::Localize(const ImageView& image, const Prior& prior) {
  if (Status status = CheckImage(image); !status.ok()) return status;
  if (Status status = CheckPrior(prior, image); !status.ok()) return status;
  State& s = *state_;
  Fix fix;
  const std::int64_t start = s.Now();
  const ImageView small = s.shrink.ShrinkToSide(image);
  if (Status status = s.extractor->Extract(small, s.features); !status.ok()) return status;
  std::int64_t now = s.Now();
  fix.ms.features = Milliseconds(now - start);
  fix.num_features = s.features.size();
  s.columns_per_column = float(image.width) / float(small.width);
  s.rows_per_row = float(image.height) / float(small.height);
  s.last_place = -1;
  if (fix.num_features < kMinFeatures) {
    fix.reasons |= kTooFewFeatures;
    s.ClearScores();
  } else {
    s.ChooseCamera(prior, small.width, small.height);
    const bool tracked = s.Track(prior, fix);
    fix.ms.pose = Milliseconds(s.Now() - now);
    now = s.Now();
    if (!tracked) {
      s.Score(fix);
      if (!s.places) s.LocateByScore(fix);
      fix.ms.score = Milliseconds(s.Now() - now);
      now = s.Now();
      if (s.places) s.LocateByDetails(fix);
      fix.ms.verify = Milliseconds(s.Now() - now);
      now = s.Now();
      if (s.pose_finder) s.FindPose(prior, fix);
      fix.ms.pose += Milliseconds(s.Now() - now);
    }
  }
  s.last_has_pose = fix.has_pose;
  if (!fix.localized) fix.reasons |= ImageReasons(small);
  fix.ms.total = Milliseconds(s.Now() - start);
  return fix;
}

// Whether a key point speaks for the last fix.
bool Localizer::State::Matched(int i) const {
  if (last_place >= 0 && places->choices()[i] == last_place) return true;
  if (!last_has_pose) return false;
  const Keypoint& keypoint = features.keypoints()[i];
  const std::span<const PoseMatch> matches = pose_finder->inliers();
  return std::any_of(matches.begin(), matches.end(), [&](const PoseMatch& match) {
    return match.pixel.x() == double{keypoint.x} && match.pixel.y() == double{keypoint.y};
  });
}

std::span<const SeenPoint> Localizer::SeenPoints() {
  constexpr float kSigmas = 2.5F;  // what a filter of SURF's covers, roughly
  State& s = *state_;
  s.seen_points.clear();
  for (int i = 0; i < s.features.size(); ++i) {
    const Keypoint& keypoint = s.features.keypoints()[i];
    // The inverse of Shrinker's map.
    s.seen_points.push_back({(keypoint.x + 0.5F) * s.columns_per_column - 0.5F,
                             (keypoint.y + 0.5F) * s.rows_per_row - 0.5F,
                             kSigmas * keypoint.sigma * s.columns_per_column, s.Matched(i)});
  }
  return s.seen_points;
}

std::span<const float> Localizer::pair_scores() const { return state_->pair_scores; }
std::span<const float> Localizer::location_scores() const { return state_->location_scores; }
std::span<const float> Localizer::keyframe_similarities() const {
  return state_->keyframe_similarities;
}

}  // namespace viewfix
