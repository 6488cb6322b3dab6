// SPDX-License-Identifier: BSD-3-Clause
#include "engine/localizer.h"

#include <algorithm>
#include <utility>

#include "engine/base/exp.h"
#include "engine/image/resize.h"
#include "engine/retrieval/retrieval.h"
#include "engine/scoring/scoring.h"
#include "engine/vocabulary/vocabulary.h"

namespace viewfix {
namespace {

FeatureOptions OptionsOf(const ModelFeatures& f) {
  return {.type = static_cast<FeatureType>(f.type),
          .max_image_side = f.max_image_side,
          .max_features = f.max_features,
          .upright = f.upright,
          .threshold = f.threshold};
}

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
  return {};
}

}  // namespace

const char* ReasonName(Reason reason) {
  switch (reason) {
    case kTooFewFeatures:
      return "too_few_features";
    case kUnknownPlace:
      return "unknown_place";
    case kAmbiguous:
      return "ambiguous";
  }
  return "";
}

struct Localizer::State {
  State(const ModelView& model_view, const LocalizerOptions& localizer_options,
        std::unique_ptr<FeatureExtractor> feature_extractor)
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
        keyframe_similarities(model.keyframes().size) {}

  std::int64_t Now() const { return options.now_ns == nullptr ? 0 : options.now_ns(); }

  int NearestKeyframe(int pair_idx) const;
  int BestOtherLocation(const Fix& fix) const;
  void Score(Fix& fix);
  void FindRivals(Fix& fix) const;
  void Decide(Fix& fix) const;

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
};

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

void Localizer::State::Decide(Fix& fix) const {
  const ModelConfidence& curve = model.confidence();
  fix.confidence =
      static_cast<float>(1.0 / (1.0 + Exp(-(double{curve.offset} + double{curve.slope} * fix.margin))));
  fix.localized = fix.confidence >= curve.threshold;
  if (!fix.localized) fix.reasons |= fix.num_rivals > 0 ? kAmbiguous : kUnknownPlace;
}

Localizer::Localizer(std::unique_ptr<State> state) : state_(std::move(state)) {}
Localizer::Localizer(Localizer&&) noexcept = default;
Localizer& Localizer::operator=(Localizer&&) noexcept = default;
Localizer::~Localizer() = default;

Result<Localizer> Localizer::Create(const ModelView& model, const LocalizerOptions& options,
                                    std::unique_ptr<FeatureExtractor> extractor) {
  if (extractor == nullptr) {
    auto created = CreateFeatureExtractor(OptionsOf(model.features()));
    if (!created.ok()) return created.status();
    extractor = std::move(*created);
  }
  if (Status status = CheckExtractor(model.features(), *extractor); !status.ok()) return status;
  return Localizer(std::make_unique<State>(model, options, std::move(extractor)));
}

Result<Fix> Localizer::Localize(const ImageView& image, const Prior& /*prior*/) {
  if (Status status = CheckImage(image); !status.ok()) return status;
  State& s = *state_;
  Fix fix;
  const std::int64_t start = s.Now();
  if (Status status = s.extractor->Extract(s.shrink.ShrinkToSide(image), s.features);
      !status.ok()) {
    return status;
  }
  const std::int64_t extracted = s.Now();
  fix.num_features = s.features.size();
  if (fix.num_features < kMinFeatures) {
    fix.reasons |= kTooFewFeatures;
    std::fill(s.pair_scores.begin(), s.pair_scores.end(), 0.0F);
    std::fill(s.location_scores.begin(), s.location_scores.end(), 0.0F);
    std::fill(s.keyframe_similarities.begin(), s.keyframe_similarities.end(), 0.0F);
  } else {
    s.Score(fix);
    s.FindRivals(fix);
    s.Decide(fix);
  }
  const std::int64_t end = s.Now();
  fix.ms.features = static_cast<float>(extracted - start) * 1e-6F;
  fix.ms.score = static_cast<float>(end - extracted) * 1e-6F;
  fix.ms.total = static_cast<float>(end - start) * 1e-6F;
  return fix;
}

std::span<const float> Localizer::pair_scores() const { return state_->pair_scores; }
std::span<const float> Localizer::location_scores() const { return state_->location_scores; }
std::span<const float> Localizer::keyframe_similarities() const {
  return state_->keyframe_similarities;
}

}  // namespace viewfix
