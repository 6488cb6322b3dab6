// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/details.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <optional>

#include "engine/matching/place_evidence.h"
#include "engine/scoring/scoring.h"
#include "engine/vocabulary/vocabulary.h"
#include "firmware_tools/training/kmeans.h"
#include "models/model_writer.h"

namespace viewfix {
namespace {

// Descriptors that a codebook is made of; more do not change it much.
constexpr std::size_t kCodebookSamples = 60'000;
constexpr int kMergeBeforeShorter = 5;     // further, and codes are shortened instead
constexpr int kParts[] = {8, 6, 5, 4};     // bytes of a code to try, the longest first
constexpr double kMaxMergeDistance = 180;  // of two descriptors that have nothing in common

struct Feature {
  int sample = 0;
  int idx = 0;
};

// A descriptor without its word; what is beyond a byte is rare, and cut.
void SubtractWord(const std::int8_t* descriptor, const std::int8_t* word, int dim,
                  std::int8_t* rest) {
  for (int i = 0; i < dim; ++i) {
    rest[i] = static_cast<std::int8_t>(std::clamp(descriptor[i] - word[i], -127, 127));
  }
}

// Squared distance of two descriptors.
std::int32_t Distance2(const std::int8_t* a, const std::int8_t* b, int dim) {
  std::int32_t sum = 0;
  for (int i = 0; i < dim; ++i) {
    const auto difference = static_cast<std::int16_t>(a[i] - b[i]);
    sum += std::int32_t{difference} * difference;
  }
  return sum;
}

// Directions of a covariance dealt to the parts of a code so that each part has about the same
// volume to cover: the parametric solution of [1], whose rows are the directions, part after part.
// Where the parts do not divide the dimension, the narrowest directions are left out.
// [1] T. Ge, K. He, Q. Ke, J. Sun, Optimized Product Quantization, CVPR 2013.
std::vector<std::int8_t> BalancedRotation(const Eigen::MatrixXd& covariance, int parts) {
  const int dim = static_cast<int>(covariance.rows());
  const int piece = dim / parts;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(covariance);
  std::vector<double> log_volume(parts, 0.0);
  std::vector<std::vector<int>> directions(parts);
  for (int d = dim - 1; d >= dim - parts * piece; --d) {  // the widest first
    int best = -1;
    for (int p = 0; p < parts; ++p) {
      const bool full = static_cast<int>(directions[p].size()) == piece;
      if (!full && (best < 0 || log_volume[p] < log_volume[best])) best = p;
    }
    directions[best].push_back(d);
    log_volume[best] += std::log(std::max(solver.eigenvalues()(d), 1e-3));
  }
  std::vector<std::int8_t> rotation;
  for (const std::vector<int>& of_part : directions) {
    for (const int d : of_part) {
      for (int i = 0; i < dim; ++i) {
        rotation.push_back(
            static_cast<std::int8_t>(std::lround(127.0 * solver.eigenvectors()(i, d))));
      }
    }
  }
  return rotation;
}

// What the evidence of a held-out frame was, with its own location and, as if the frame were of a
// place that the model does not know, without it.
struct HeldOutFrame {
  struct Said {
    std::vector<float> evidence;   // [locations]
    std::vector<int> close_votes;  // [locations]
    std::vector<float> likeness;   // [locations]

    void Forget(int location_idx) {
      evidence.erase(evidence.begin() + location_idx);
      close_votes.erase(close_votes.begin() + location_idx);
      likeness.erase(likeness.begin() + location_idx);
    }
  };
  Said known;
  Said elsewhere;         // of one location less
  int location_idx = -1;  // the right one; -1: the frame was not asked
};

// Of ScorePlaces() and LeadOf().
struct PlaceWeights {
  float likeness = 0;
  float close = 0;
};

// The best place by what was said, and what its confidence is a curve of.
struct Guess {
  int location_idx;
  double lead;
};

Guess GuessOf(const HeldOutFrame::Said& said, const PlaceWeights& weights) {
  std::vector<float> scores(said.likeness.size());
  ScorePlaces(said.evidence, said.likeness, weights.likeness, scores);
  const BestPlace best = FindBestPlace(said.evidence, scores);
  const int close_votes = best.location_idx < 0 ? 0 : said.close_votes[best.location_idx];
  return {best.location_idx, double{LeadOf(best.margin, close_votes, weights.close)}};
}

std::vector<Outcome> OutcomesOf(const std::vector<HeldOutFrame>& frames,
                                const PlaceWeights& weights) {
  std::vector<Outcome> outcomes;
  for (const HeldOutFrame& frame : frames) {
    if (frame.location_idx < 0) continue;
    const Guess guess = GuessOf(frame.known, weights);
    outcomes.push_back({guess.lead, guess.location_idx == frame.location_idx});
  }
  return outcomes;
}

// Outcomes, all of them wrong, of the frames whose locations are hidden.
//   weight  what each counts for
std::vector<Outcome> OutcomesElsewhere(const std::vector<HeldOutFrame>& frames,
                                       const PlaceWeights& weights, double weight) {
  std::vector<Outcome> outcomes;
  for (const HeldOutFrame& frame : frames) {
    if (frame.location_idx < 0) continue;
    outcomes.push_back({GuessOf(frame.elsewhere, weights).lead, false, weight});
  }
  return outcomes;
}

// The weight of those tried whose outcomes a curve fits best.
template <typename OutcomesAt>
float ChooseWeight(std::span<const float> tried, const OutcomesAt& outcomes_at) {
  float best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (const float weight : tried) {
    const std::vector<Outcome> outcomes = outcomes_at(weight);
    const double loss = LogLoss(outcomes, FitConfidence(outcomes));
    if (loss < least) {
      least = loss;
      best = weight;
    }
  }
  return best;
}

// The weights with which it is told best whether the location is right: likeness among known
// locations, then close details, known locations from hidden ones. Both at once would let the rare
// hidden frames say how known ones are told apart.
PlaceWeights ChooseWeights(const std::vector<HeldOutFrame>& frames, double hidden_weight) {
  constexpr float kLikeness[] = {0.0F, 1.5F, 3.0F, 4.5F, 6.0F, 9.0F};
  constexpr float kClose[] = {0.0F, 0.1F, 0.2F, 0.3F, 0.4F, 0.5F, 0.6F, 0.8F, 1.0F};
  PlaceWeights weights;
  weights.likeness = ChooseWeight(
      kLikeness, [&](float likeness) { return OutcomesOf(frames, {.likeness = likeness}); });
  weights.close = ChooseWeight(kClose, [&](float close) {
    const PlaceWeights tried = {weights.likeness, close};
    std::vector<Outcome> outcomes = OutcomesOf(frames, tried);
    const auto elsewhere = OutcomesElsewhere(frames, tried, hidden_weight);
    outcomes.insert(outcomes.end(), elsewhere.begin(), elsewhere.end());
    return outcomes;
  });
  return weights;
}

class DetailTrainer {
 public:
  DetailTrainer(const DetailSource& source, const DetailOptions& options)
      : source_(source), options_(options), dim_(source.features.dim) {}

  TrainedDetails Train(const Progress& progress) {
    TrainedDetails trained;
    const std::vector<Feature> some = SomeFeatures();
    if (some.size() < kCodesOfPart) return trained;
    AssignWords();
    const std::vector<bool> all(source_.image_idxs.size(), true);
    for (const int parts : PartsToTry()) {
      parts_ = parts;
      TurnDescriptors(some);
      ListFeatures();
      FindCommon();
      if (Fits(all, options_.merge_distance + kMergeBeforeShorter)) break;
    }
    const std::optional<double> merge = LeastMergeThatFits(all);
    if (!merge) return trained;
    MakeCodebook(some);
    Encode(progress);
    ModelData::DetailsData table = MakeTable(all, *merge);
    const std::vector<HeldOutFrame> frames = HoldOut(*merge);
    const PlaceWeights weights = ChooseWeights(frames, options_.hidden_weight);
    table.likeness_weight = weights.likeness;
    table.close_weight = weights.close;
    trained.held_out = OutcomesOf(frames, weights);
    trained.elsewhere = OutcomesElsewhere(frames, weights, 1);
    trained.table = std::move(table);
    return trained;
  }

 private:
  const ImageFeatures& Image(int sample) const {
    return source_.features.images[source_.image_idxs[sample]];
  }
  int NumFeatures(int sample) const { return static_cast<int>(Image(sample).keypoints.size()); }
  const std::int8_t* Descriptor(const Feature& f) const {
    return Image(f.sample).descriptors.data() + std::size_t(f.idx) * dim_;
  }
  const std::int8_t* Turned(const Feature& f) const {
    return turned_[f.sample].data() + std::size_t(f.idx) * TurnedDim();
  }
  int TurnedDim() const { return static_cast<int>(rotation_.size()) / dim_; }
  int NumSamples() const { return static_cast<int>(source_.image_idxs.size()); }
  int NumWords() const { return static_cast<int>(source_.words.size()) / dim_; }
  int WordOf(const Feature& f) const {
    return words_[f.sample][std::size_t(f.idx) * source_.words_per_feature];
  }

  void AssignWords() {
    const Vocabulary vocabulary(source_.words, dim_);
    words_.resize(NumSamples());
    ParallelFor(NumSamples(), options_.jobs, [&](int s) {
      words_[s].resize(Image(s).keypoints.size() * source_.words_per_feature);
      vocabulary.NearestWords(Image(s).descriptors, source_.words_per_feature, words_[s]);
    });
  }

  // A sample of all features, evenly.
  std::vector<Feature> SomeFeatures() const {
    std::size_t total = 0;
    for (int s = 0; s < NumSamples(); ++s) total += Image(s).keypoints.size();
    const std::size_t step = std::max<std::size_t>(1, total / kCodebookSamples);
    std::vector<Feature> some;
    std::size_t count = 0;
    for (int s = 0; s < NumSamples(); ++s) {
      for (int i = 0; i < NumFeatures(s); ++i) {
        if (count++ % step == 0) some.push_back({s, i});
      }
    }
    return some;
  }

  void TurnDescriptors(const std::vector<Feature>& some) {
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(dim_, dim_);
    std::vector<std::int8_t> rest(dim_);
    for (const Feature& f : some) {
      SubtractWord(Descriptor(f), source_.words.data() + std::size_t(WordOf(f)) * dim_, dim_,
                   rest.data());
      const Eigen::VectorXd r =
          Eigen::Map<const Eigen::Matrix<std::int8_t, Eigen::Dynamic, 1>>(rest.data(), dim_)
              .cast<double>();
      covariance += r * r.transpose();
    }
    rotation_ = BalancedRotation(covariance / static_cast<double>(some.size()), parts_);
    if (!source_.rotation.empty()) {
      rotation_.assign(source_.rotation.begin(), source_.rotation.end());
    }
    turned_words_ = TurnAll(source_.words);
    turned_.resize(NumSamples());
    ParallelFor(NumSamples(), options_.jobs,
                [&](int s) { turned_[s] = TurnAll(Image(s).descriptors); });
  }

  std::vector<std::int8_t> TurnAll(std::span<const std::int8_t> descriptors) const {
    const Turner turner(rotation_, dim_);
    std::vector<std::int8_t> turned(descriptors.size() / dim_ * turner.turned_dim());
    turner.Turn(descriptors, turned.data());
    return turned;
  }

  void Rest(const Feature& f, std::int8_t* rest) const {
    SubtractWord(Turned(f), turned_words_.data() + std::size_t(WordOf(f)) * TurnedDim(),
                 TurnedDim(), rest);
  }

  void MakeCodebook(const std::vector<Feature>& some) {
    codebook_.assign(source_.codebook.begin(), source_.codebook.end());
    if (!codebook_.empty()) return;
    const int piece = TurnedDim() / parts_;
    std::vector<std::vector<std::int8_t>> pieces(parts_);
    std::vector<std::int8_t> rest(TurnedDim());
    for (const Feature& f : some) {
      Rest(f, rest.data());
      for (int p = 0; p < parts_; ++p) {
        pieces[p].insert(pieces[p].end(), rest.begin() + p * piece, rest.begin() + (p + 1) * piece);
      }
    }
    for (int p = 0; p < parts_; ++p) {
      const KMeansOptions clustering = {.num_words = kCodesOfPart,
                                        .seed = static_cast<std::uint64_t>(p) + 1,
                                        .jobs = options_.jobs};
      const auto centres = ClusterDescriptors(pieces[p], piece, clustering).words;
      codebook_.insert(codebook_.end(), centres.begin(), centres.end());
    }
  }

  void Encode(const Progress& progress) {
    const int piece = TurnedDim() / parts_;
    std::vector<Vocabulary> parts;
    for (int p = 0; p < parts_; ++p) {
      const std::size_t size = std::size_t(kCodesOfPart) * piece;
      parts.emplace_back(std::span(codebook_).subspan(p * size, size), piece);
    }
    codes_.resize(NumSamples());
    const auto encode = [&](int s) {
      std::vector<std::int8_t> rest(TurnedDim());
      codes_[s].resize(std::size_t(NumFeatures(s)) * parts_);
      for (int i = 0; i < NumFeatures(s); ++i) {
        Rest({s, i}, rest.data());
        for (int p = 0; p < parts_; ++p) {
          std::uint16_t code = 0;
          parts[p].NearestWords(std::span(rest).subspan(p * piece, piece), 1, {&code, 1});
          codes_[s][std::size_t(i) * parts_ + p] = static_cast<std::uint8_t>(code);
        }
      }
    };
    ParallelFor(NumSamples(), options_.jobs, encode, progress);
  }

  void ListFeatures() {
    lists_.assign(2 * std::size_t(NumWords()), {});
    for (int s = 0; s < NumSamples(); ++s) {
      for (int i = 0; i < NumFeatures(s); ++i) {
        const int dark = Image(s).keypoints[i].laplacian_sign < 0 ? 1 : 0;
        lists_[2 * WordOf({s, i}) + dark].push_back({s, i});
      }
    }
    for (std::vector<Feature>& list : lists_) {
      std::stable_sort(list.begin(), list.end(), [&](const Feature& a, const Feature& b) {
        return source_.locations[a.sample] < source_.locations[b.sample];
      });
    }
  }

  bool AreAlike(const Feature& a, const Feature& b, double distance2) const {
    return Distance2(Turned(a), Turned(b), TurnedDim()) < distance2;
  }

  // Takes out of every list what many locations have, one of each kind kept aside.
  void FindCommon() {
    common_.assign(lists_.size(), {});
    ParallelFor(static_cast<int>(lists_.size()), options_.jobs, [&](int l) { TakeCommon(l); });
  }

  void TakeCommon(int l) {
    std::vector<Feature>& list = lists_[l];
    std::vector<bool> taken(list.size(), false);
    for (std::size_t i = 0; i < list.size(); ++i) {
      if (taken[i]) continue;
      const std::vector<std::size_t> alike = AlikeAndLeft(list, taken, list[i]);
      if (LocationsOf(list, alike) < options_.common_locations) continue;
      for (const std::size_t j : alike) taken[j] = true;
      common_[l].push_back(list[i]);
    }
    std::size_t left = 0;
    for (std::size_t i = 0; i < list.size(); ++i) {
      if (!taken[i]) list[left++] = list[i];
    }
    list.resize(left);
  }

  std::vector<std::size_t> AlikeAndLeft(const std::vector<Feature>& list,
                                        const std::vector<bool>& taken, const Feature& f) const {
    const double distance2 = options_.common_distance * options_.common_distance;
    std::vector<std::size_t> alike;
    for (std::size_t j = 0; j < list.size(); ++j) {
      if (!taken[j] && AreAlike(f, list[j], distance2)) alike.push_back(j);
    }
    return alike;
  }

  // How many there are among `members` of a list, which is in order of locations.
  int LocationsOf(const std::vector<Feature>& list, const std::vector<std::size_t>& members) const {
    int count = 0, last = -1;
    for (const std::size_t j : members) {
      const int location = source_.locations[list[j].sample];
      count += location != last ? 1 : 0;
      last = location;
    }
    return count;
  }

  // Of a list, those used, the first of those that are alike within a location.
  std::vector<Feature> Distinct(const std::vector<Feature>& list, const std::vector<bool>& used,
                                double merge2) const {
    std::vector<Feature> kept;
    std::size_t begin = 0;  // of the location's own
    for (const Feature& f : list) {
      if (!used[f.sample]) continue;
      if (!kept.empty() && source_.locations[kept.back().sample] != source_.locations[f.sample]) {
        begin = kept.size();
      }
      const auto alike = [&](const Feature& other) { return AreAlike(f, other, merge2); };
      if (std::none_of(kept.begin() + begin, kept.end(), alike)) kept.push_back(f);
    }
    return kept;
  }

  // The details of the images used: those of each location, then the common ones; and how many of
  // them are in each list.
  struct Chosen {
    std::vector<std::vector<Feature>> by_location;  // [locations + 1]
    std::vector<std::uint8_t> list_size;            // [locations + 1, lists]
  };

  Chosen ChooseDetails(const std::vector<bool>& used, double merge) const {
    const std::size_t lists = lists_.size();
    std::vector<std::vector<Feature>> kept(lists);
    ParallelFor(static_cast<int>(lists), options_.jobs,
                [&](int l) { kept[l] = Distinct(lists_[l], used, merge * merge); });
    Chosen chosen;
    chosen.by_location.resize(std::size_t(source_.num_locations) + 1);
    chosen.list_size.resize(chosen.by_location.size() * lists, 0);
    const auto add = [&](int location, std::size_t list, const Feature& f) {
      std::uint8_t& size = chosen.list_size[location * lists + list];
      if (size == 255) return;
      ++size;
      chosen.by_location[location].push_back(f);
    };
    for (std::size_t l = 0; l < lists; ++l) {
      for (const Feature& f : kept[l]) add(source_.locations[f.sample], l, f);
      for (const Feature& f : common_[l]) add(source_.num_locations, l, f);
    }
    return chosen;
  }

  std::vector<int> PartsToTry() const {
    if (options_.parts > 0) return {options_.parts};
    std::vector<int> parts;
    for (const int p : kParts) parts.push_back(std::min(p, dim_));
    return parts;
  }

  // Codes and lists: what grows with the details.
  bool Fits(const std::vector<bool>& used, double merge) const {
    const std::vector<std::uint8_t> list_size = ChooseDetails(used, merge).list_size;
    const std::size_t details = std::accumulate(list_size.begin(), list_size.end(), std::size_t{0});
    return details * parts_ + DetailListBytes(list_size, lists_.size()) <= options_.max_bytes;
  }

  // In whole steps, by bisection: details that are merged farther are hardly ever more.
  std::optional<double> LeastMergeThatFits(const std::vector<bool>& used) const {
    const auto fits = [&](int further) { return Fits(used, options_.merge_distance + further); };
    int too_near = -1;
    int enough = kMergeBeforeShorter;
    if (!fits(enough)) {
      too_near = enough;
      enough = static_cast<int>(kMaxMergeDistance - options_.merge_distance);
      if (!fits(enough)) return std::nullopt;
    }
    while (enough - too_near > 1) {
      const int middle = (too_near + enough) / 2;
      (fits(middle) ? enough : too_near) = middle;
    }
    return options_.merge_distance + enough;
  }

  ModelData::DetailsData MakeTable(const std::vector<bool>& used, double merge) const {
    Chosen chosen = ChooseDetails(used, merge);
    ModelData::DetailsData table{parts_, rotation_, codebook_, std::move(chosen.list_size), {}, 0};
    for (const std::vector<Feature>& of_location : chosen.by_location) {
      for (const Feature& f : of_location) {
        const auto code = codes_[f.sample].begin() + std::size_t(f.idx) * parts_;
        table.codes.insert(table.codes.end(), code, code + parts_);
      }
    }
    return table;
  }

  // Each image's place among its location's; -1: it is the only one.
  std::vector<int> FoldOfSample() const {
    std::vector<int> count(source_.num_locations, 0);
    std::vector<int> fold;
    for (const int l : source_.locations) fold.push_back(count[l]++ % options_.folds);
    for (int s = 0; s < NumSamples(); ++s) {
      if (count[source_.locations[s]] < 2) fold[s] = -1;
    }
    return fold;
  }

  std::vector<float> LikenessOf(int frame, const std::vector<bool>& used) const {
    std::vector<float> likeness(source_.num_locations, kNoSimilarity);
    for (int k = 0; k < NumSamples(); ++k) {
      float& best = likeness[source_.locations[k]];
      if (used[k]) best = std::max(best, source_.similarities(k, frame));
    }
    return likeness;
  }

  // Common details stay those of all images: what four locations have, three have without a frame.
  std::vector<HeldOutFrame> HoldOut(double merge) const {
    const std::vector<int> fold_of_sample = FoldOfSample();
    std::vector<HeldOutFrame> frames(NumSamples());
    int most_features = 0;
    for (int s = 0; s < NumSamples(); ++s) most_features = std::max(most_features, NumFeatures(s));
    for (int fold = 0; fold < options_.folds; ++fold) {
      std::vector<bool> used;
      for (const int f : fold_of_sample) used.push_back(f != fold);
      const ModelData::DetailsData table = MakeTable(used, merge);
      const ModelDetails details = {static_cast<int>(table.codes.size()) / table.parts,
                                    table.parts,
                                    table.rotation,
                                    table.codebook,
                                    table.list_size,
                                    table.codes,
                                    0};
      std::vector<std::unique_ptr<PlaceEvidence>> weighers(Workers(options_.jobs));
      for (auto& weigher : weighers) {
        weigher = std::make_unique<PlaceEvidence>(source_.words, dim_, details,
                                                  source_.num_locations, most_features);
      }
      ParallelForWorkers(NumSamples(), options_.jobs, [&](int s, int worker) {
        if (used[s]) return;
        PlaceEvidence& weigher = *weighers[worker];
        const std::vector<float> likeness = LikenessOf(s, used);
        const auto said = [&](int hidden) {
          weigher.Weigh(Image(s).descriptors, Image(s).keypoints, words_[s],
                        source_.words_per_feature, hidden);
          const auto evidence = weigher.evidence();
          const auto close_votes = weigher.close_votes();
          return HeldOutFrame::Said{{evidence.begin(), evidence.end()},
                                    {close_votes.begin(), close_votes.end()},
                                    likeness};
        };
        const int location = source_.locations[s];
        frames[s] = {said(-1), said(location), location};
        frames[s].elsewhere.Forget(location);
      });
    }
    return frames;
  }

  const DetailSource& source_;
  const DetailOptions& options_;
  int dim_;
  int parts_ = 0;                                  // bytes of a code
  std::vector<std::vector<std::uint16_t>> words_;  // [samples][features, words_per_feature]
  std::vector<std::int8_t> rotation_;              // [turned dim, dim]
  std::vector<std::int8_t> turned_words_;          // [words, turned dim]
  std::vector<std::vector<std::int8_t>> turned_;   // [samples][features, turned dim]
  std::vector<std::int8_t> codebook_;
  std::vector<std::vector<std::uint8_t>> codes_;  // [samples][features, parts]
  std::vector<std::vector<Feature>> lists_;       // [2 words] by location, without common ones
  std::vector<std::vector<Feature>> common_;      // [2 words]
};

}  // namespace

TrainedDetails TrainDetails(const DetailSource& source, const DetailOptions& options,
                            const Progress& progress) {
  const int dim = source.features.dim;
  if (options.max_bytes == 0 || options.parts > dim) return {};
  return DetailTrainer(source, options).Train(progress);
}

ModelConfidence FitDetailConfidence(const TrainedDetails& details, const DetailOptions& options) {
  const auto frames = static_cast<double>(details.held_out.size());
  const auto wrong = static_cast<double>(
      std::ranges::count_if(details.held_out, [](const Outcome& o) { return !o.right; }));
  const double missing = std::max(0.0, options.hidden_weight * frames - wrong);
  std::vector<Outcome> outcomes = details.held_out;
  for (Outcome hidden : details.elsewhere) {
    hidden.weight = missing / static_cast<double>(details.elsewhere.size());
    outcomes.push_back(hidden);
  }
  ModelConfidence confidence = FitConfidence(outcomes);
  LimitWrongAnswers(details.held_out, options.wrong_share, confidence);
  return confidence;
}

}  // namespace viewfix
