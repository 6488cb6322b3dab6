// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/details.h"

#include <algorithm>
#include <memory>

#include "engine/matching/place_evidence.h"
#include "engine/vocabulary/vocabulary.h"
#include "firmware_tools/training/kmeans.h"

namespace viewfix {
namespace {

// Descriptors that a codebook is made of; more do not change it much.
constexpr std::size_t kCodebookSamples = 60'000;
constexpr double kMergeStep = 5;
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

class DetailTrainer {
 public:
  DetailTrainer(const DetailSource& source, const DetailOptions& options)
      : source_(source), options_(options), dim_(source.features.dim) {}

  TrainedDetails Train(const Progress& progress) {
    TrainedDetails trained;
    AssignWords();
    if (!MakeCodebook()) return trained;
    Encode(progress);
    ListFeatures();
    const std::vector<bool> all(source_.image_idxs.size(), true);
    for (double merge = options_.merge_distance; merge <= kMaxMergeDistance; merge += kMergeStep) {
      ModelData::DetailsData table = MakeTable(all, merge);
      if (table.location.size() * (options_.parts + 2) > options_.max_bytes) continue;
      trained.table = std::move(table);
      trained.held_out = HoldOut(merge);
      break;
    }
    return trained;
  }

 private:
  const ImageFeatures& Image(int sample) const {
    return source_.features.images[source_.image_idxs[sample]];
  }
  const std::int8_t* Descriptor(const Feature& f) const {
    return Image(f.sample).descriptors.data() + std::size_t(f.idx) * dim_;
  }
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

  void Rest(const Feature& f, std::int8_t* rest) const {
    SubtractWord(Descriptor(f), source_.words.data() + std::size_t(WordOf(f)) * dim_, dim_, rest);
  }

  // False: too few features to make one of.
  bool MakeCodebook() {
    codebook_.assign(source_.codebook.begin(), source_.codebook.end());
    if (!codebook_.empty()) return true;
    std::size_t total = 0;
    for (int s = 0; s < NumSamples(); ++s) total += Image(s).keypoints.size();
    const std::size_t step = std::max<std::size_t>(1, total / kCodebookSamples);
    const int piece = dim_ / options_.parts;
    std::vector<std::vector<std::int8_t>> pieces(options_.parts);
    std::vector<std::int8_t> rest(dim_);
    std::size_t count = 0;
    for (int s = 0; s < NumSamples(); ++s) {
      for (int i = 0; i < static_cast<int>(Image(s).keypoints.size()); ++i) {
        if (count++ % step != 0) continue;
        Rest({s, i}, rest.data());
        for (int p = 0; p < options_.parts; ++p) {
          pieces[p].insert(pieces[p].end(), rest.begin() + p * piece,
                           rest.begin() + (p + 1) * piece);
        }
      }
    }
    if (pieces[0].size() / piece < kCodesOfPart) return false;
    for (int p = 0; p < options_.parts; ++p) {
      const KMeansOptions clustering = {.num_words = kCodesOfPart,
                                        .seed = static_cast<std::uint64_t>(p) + 1,
                                        .jobs = options_.jobs};
      const auto centres = ClusterDescriptors(pieces[p], piece, clustering).words;
      codebook_.insert(codebook_.end(), centres.begin(), centres.end());
    }
    return true;
  }

  void Encode(const Progress& progress) {
    const int piece = dim_ / options_.parts;
    std::vector<Vocabulary> parts;
    for (int p = 0; p < options_.parts; ++p) {
      const std::size_t size = std::size_t(kCodesOfPart) * piece;
      parts.emplace_back(std::span(codebook_).subspan(p * size, size), piece);
    }
    codes_.resize(NumSamples());
    const auto encode = [&](int s) {
      const int n = static_cast<int>(Image(s).keypoints.size());
      std::vector<std::int8_t> rest(dim_);
      codes_[s].resize(std::size_t(n) * options_.parts);
      for (int i = 0; i < n; ++i) {
        Rest({s, i}, rest.data());
        for (int p = 0; p < options_.parts; ++p) {
          std::uint16_t code = 0;
          parts[p].NearestWords(std::span(rest).subspan(p * piece, piece), 1, {&code, 1});
          codes_[s][std::size_t(i) * options_.parts + p] = static_cast<std::uint8_t>(code);
        }
      }
    };
    ParallelFor(NumSamples(), options_.jobs, encode, progress);
  }

  void ListFeatures() {
    lists_.resize(2 * std::size_t(NumWords()));
    for (int s = 0; s < NumSamples(); ++s) {
      for (int i = 0; i < static_cast<int>(Image(s).keypoints.size()); ++i) {
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

  bool AreAlike(const Feature& a, const Feature& b, double merge2) const {
    const std::int8_t* x = Descriptor(a);
    const std::int8_t* y = Descriptor(b);
    std::int32_t distance2 = 0;
    for (int i = 0; i < dim_; ++i) {
      const std::int32_t difference = x[i] - y[i];
      distance2 += difference * difference;
    }
    return distance2 < merge2;
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

  ModelData::DetailsData MakeTable(const std::vector<bool>& used, double merge) const {
    std::vector<std::vector<Feature>> kept(lists_.size());
    ParallelFor(static_cast<int>(lists_.size()), options_.jobs,
                [&](int l) { kept[l] = Distinct(lists_[l], used, merge * merge); });
    ModelData::DetailsData table{options_.parts, codebook_, {0}, {}, {}};
    for (const std::vector<Feature>& list : kept) {
      for (const Feature& f : list) {
        table.location.push_back(static_cast<std::uint16_t>(source_.locations[f.sample]));
        const auto code = codes_[f.sample].begin() + std::size_t(f.idx) * options_.parts;
        table.codes.insert(table.codes.end(), code, code + options_.parts);
      }
      table.list_begin.push_back(static_cast<std::uint32_t>(table.location.size()));
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

  std::vector<Outcome> HoldOut(double merge) const {
    const std::vector<int> fold_of_sample = FoldOfSample();
    std::vector<Outcome> outcomes(NumSamples());
    for (int fold = 0; fold < options_.folds; ++fold) {
      std::vector<bool> used;
      for (const int f : fold_of_sample) used.push_back(f != fold);
      const ModelData::DetailsData table = MakeTable(used, merge);
      const ModelDetails details = {static_cast<int>(table.location.size()),
                                    table.parts,
                                    table.codebook,
                                    table.list_begin,
                                    table.location,
                                    table.codes};
      std::vector<std::unique_ptr<PlaceEvidence>> weighers(Workers(options_.jobs));
      for (auto& weigher : weighers) {
        weigher =
            std::make_unique<PlaceEvidence>(source_.words, dim_, details, source_.num_locations);
      }
      ParallelForWorkers(NumSamples(), options_.jobs, [&](int s, int worker) {
        if (used[s]) return;
        PlaceEvidence& weigher = *weighers[worker];
        weigher.Weigh(Image(s).descriptors, Image(s).keypoints, words_[s],
                      source_.words_per_feature);
        const PlaceEvidence::Best best = weigher.FindBest();
        outcomes[s] = {best.margin, best.location_idx == source_.locations[s]};
      });
    }
    std::vector<Outcome> asked;
    for (int s = 0; s < NumSamples(); ++s) {
      if (fold_of_sample[s] >= 0) asked.push_back(outcomes[s]);
    }
    return asked;
  }

  const DetailSource& source_;
  const DetailOptions& options_;
  int dim_;
  std::vector<std::vector<std::uint16_t>> words_;  // [samples][features, words_per_feature]
  std::vector<std::int8_t> codebook_;
  std::vector<std::vector<std::uint8_t>> codes_;  // [samples][features, parts]
  std::vector<std::vector<Feature>> lists_;       // [2 words] by location
};

}  // namespace

TrainedDetails TrainDetails(const DetailSource& source, const DetailOptions& options,
                            const Progress& progress) {
  const int dim = source.features.dim;
  if (options.max_bytes == 0 || options.parts > dim || dim % options.parts != 0) return {};
  return DetailTrainer(source, options).Train(progress);
}

}  // namespace viewfix
