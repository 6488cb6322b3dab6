// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <map>
#include <string>

#include "engine/matching/descriptor_matcher.h"
#include "firmware_tools/evaluation/check_set.h"
#include "firmware_tools/evaluation/check_text.h"
#include "firmware_tools/evaluation/metrics.h"

namespace viewfix {
namespace {

// Shares of matched features (see MatchShare), as measured on walks through real buildings:
// unrelated images 0.01, images a second apart 0.06, a step apart 0.2.
constexpr double kWalkShare = 0.05;  // usual between neighbours where order means a walk
constexpr double kBreakShare = 0.2;  // of the walk's usual share: the thread is lost
constexpr double kSameSceneShare =
    0.08;                               // with another location's image: the same scene, or a twin
constexpr double kForeignShare = 0.25;  // own location's share against the other's
constexpr double kSamePictureShare = 0.5;
constexpr float kSamePictureGram = 0.8F;  // histograms' dot product: worth matching
constexpr std::size_t kShortestWalk = 5;  // images
constexpr int kOwnTried = 3;              // nearest images of the own location to match with

// Share of the poorer image's features with a distinct, mutually nearest feature in the other.
// Distinct: Lowe's ratio test (IJCV 2004).
double MatchShare(const ImageFeatures& a, const ImageFeatures& b, int dim) {
  const int size_a = static_cast<int>(a.keypoints.size());
  const int size_b = static_cast<int>(b.keypoints.size());
  DescriptorMatcher matcher(size_a, size_b, dim);
  std::vector<DescriptorMatch> found(size_a);
  const Result<int> matches =
      matcher.Match({a.descriptors}, {b.descriptors}, {.max_ratio = 0.8F, .mutual = true}, found);
  if (!matches.ok()) throw ToolError(std::string("matching: ") + matches.status().text());
  return static_cast<double>(*matches) / std::max(1, std::min(size_a, size_b));
}

// The samples of a preparation, and what matching says of them.
class Samples {
 public:
  Samples(const ImageSet& set, const Preparation& prepared) : set_(set), prepared_(prepared) {}

  int size() const { return static_cast<int>(labels().image_idxs.size()); }
  const Labels& labels() const { return prepared_.labels; }
  const ImageRecord& image(int s) const { return set_.images[labels().image_idxs[s]]; }
  int location(int s) const { return labels().location[s]; }
  const std::string& location_name(int s) const { return labels().locations[location(s)]; }
  float Gram(int s, int t) const { return prepared_.gram(s, t); }
  double Share(int s, int t) const {
    const auto& images = prepared_.features.images;
    return MatchShare(images[labels().image_idxs[s]], images[labels().image_idxs[t]],
                      prepared_.features.dim);
  }

 private:
  const ImageSet& set_;
  const Preparation& prepared_;
};

// Images in the order of capture: of each named capture, else of each location and view.
std::array<std::string, 3> WalkOf(const ImageRecord& image) {
  if (!image.capture.empty()) return {image.capture, "", ""};
  return {"", image.location, image.view};
}

struct Walk {
  std::vector<int> samples;
  // [samples] An image held back for testing, or unusable, stands between it and the one before.
  std::vector<bool> has_gap;
};

std::vector<Walk> Walks(const ImageSet& set, const Labels& labels) {
  std::map<std::array<std::string, 3>, Walk> walks;
  std::map<std::array<std::string, 3>, bool> gap_of;
  int s = 0;
  for (int i = 0; i < static_cast<int>(set.images.size()); ++i) {
    const auto key = WalkOf(set.images[i]);
    const bool is_sample =
        s < static_cast<int>(labels.image_idxs.size()) && labels.image_idxs[s] == i;
    if (is_sample) {
      walks[key].samples.push_back(s++);
      walks[key].has_gap.push_back(gap_of[key]);
    }
    gap_of[key] = !is_sample;
  }
  std::vector<Walk> result;
  for (auto& [key, walk] : walks) {
    if (walk.samples.size() >= kShortestWalk) result.push_back(std::move(walk));
  }
  return result;
}

// The positions in a walk before which the thread is lost: nothing after them shows what was
// seen before. One bad image among good ones is no break, since its neighbours still match.
std::vector<std::size_t> Breaks(const Samples& samples, const Walk& walk) {
  const std::vector<int>& at = walk.samples;
  std::vector<double> steps(at.size(), 1.0);  // share with the image before
  for (std::size_t i = 1; i < at.size(); ++i) steps[i] = samples.Share(at[i - 1], at[i]);
  const double usual = *Quantile({steps.begin() + 1, steps.end()}, 0.5);
  std::vector<std::size_t> breaks;
  if (usual < kWalkShare) return breaks;
  const double least = kBreakShare * usual;
  for (std::size_t i = 1; i < at.size(); ++i) {
    const bool bridged = walk.has_gap[i] || steps[i] >= least ||
                         (i >= 2 && samples.Share(at[i - 2], at[i]) >= least) ||
                         (i + 1 < at.size() && samples.Share(at[i - 1], at[i + 1]) >= least);
    if (!bridged) breaks.push_back(i);
  }
  return breaks;
}

std::vector<Finding> CheckWalks(const ImageSet& set, const Samples& samples, int jobs,
                                const Progress& progress) {
  const std::vector<Walk> walks = Walks(set, samples.labels());
  std::vector<std::vector<std::size_t>> breaks(walks.size());
  ParallelFor(
      static_cast<int>(walks.size()), jobs, [&](int w) { breaks[w] = Breaks(samples, walks[w]); },
      progress);
  std::vector<Finding> findings;
  for (std::size_t w = 0; w < walks.size(); ++w) {
    if (breaks[w].empty()) continue;
    Finding finding{Severity::kNote, "broken_walk", ""};
    std::vector<std::string> gaps;
    for (const std::size_t i : breaks[w]) {
      const std::string& before = samples.image(walks[w].samples[i - 1]).path;
      const std::string& after = samples.image(walks[w].samples[i]).path;
      gaps.push_back(before + " -> " + after);
      finding.images.insert(finding.images.end(), {before, after});
    }
    const std::string& capture = samples.image(walks[w].samples.front()).capture;
    finding.locations = {samples.location_name(walks[w].samples.front())};
    finding.text = Text(capture.empty() ? finding.locations[0] : capture, ": the walk jumps ",
                        gaps.size(), gaps.size() == 1 ? " time" : " times",
                        ": walk on without a gap, and turn slowly (", FirstFew(gaps), ")");
    findings.push_back(std::move(finding));
  }
  return findings;
}

// What speaks against a sample's label.
struct Suspicion {
  int other = -1;           // the sample of another location that shows the same; -1: none
  bool is_foreign = false;  // and the own location's do not: this label is the wrong one
};

// The nearest samples of the same and of other locations by histogram, nearest first.
struct Nearest {
  std::vector<int> own;  // at most kOwnTried
  int other = -1;
};

Nearest NearestOf(const Samples& samples, int s) {
  Nearest nearest;
  for (int t = 0; t < samples.size(); ++t) {
    if (samples.location(t) != samples.location(s)) {
      if (nearest.other < 0 || samples.Gram(s, t) > samples.Gram(s, nearest.other)) {
        nearest.other = t;
      }
    } else if (t != s) {
      nearest.own.push_back(t);
    }
  }
  std::stable_sort(nearest.own.begin(), nearest.own.end(),
                   [&](int a, int b) { return samples.Gram(s, a) > samples.Gram(s, b); });
  if (nearest.own.size() > kOwnTried) nearest.own.resize(kOwnTried);
  return nearest;
}

Suspicion SuspicionOf(const Samples& samples, int s) {
  const Nearest nearest = NearestOf(samples, s);
  if (nearest.other < 0 || nearest.own.empty()) return {};
  const float gram = samples.Gram(s, nearest.other);
  if (gram < kSamePictureGram && gram <= samples.Gram(s, nearest.own[0])) return {};
  const double share = samples.Share(s, nearest.other);
  const bool is_foreign =
      share >= kSameSceneShare && std::all_of(nearest.own.begin(), nearest.own.end(), [&](int own) {
        return samples.Share(s, own) < kForeignShare * share;
      });
  if (!is_foreign && share < kSamePictureShare) return {};
  return {nearest.other, is_foreign};
}

Finding WrongLabel(const Samples& samples, const std::vector<int>& suspects, int other) {
  Finding finding{Severity::kWarning, "wrong_label", ""};
  for (const int s : suspects) finding.images.push_back(samples.image(s).path);
  finding.locations = {samples.location_name(suspects[0]), samples.location_name(other)};
  finding.text = Text(FirstFew(finding.images), ": labelled ", finding.locations[0],
                      ", but not like its other images; like those of ", finding.locations[1], " (",
                      samples.image(other).path, "): is the label wrong?");
  return finding;
}

Finding SamePicture(const Samples& samples, int s, int other) {
  const ImageRecord& a = samples.image(s);
  const ImageRecord& b = samples.image(other);
  return {
      Severity::kWarning,
      "near_duplicate",
      Text(a.path, " and ", b.path, " show the same, but are labelled ", samples.location_name(s),
           " and ", samples.location_name(other), ": is one label wrong?"),
      {a.path, b.path},
      {samples.location_name(s), samples.location_name(other)}};
}

std::vector<Finding> CheckLabelled(const Samples& samples, int jobs, const Progress& progress) {
  std::vector<Suspicion> suspicions(samples.size());
  ParallelFor(
      samples.size(), jobs, [&](int s) { suspicions[s] = SuspicionOf(samples, s); }, progress);
  std::vector<Finding> findings;
  std::map<std::pair<int, int>, std::vector<int>> foreign;  // own and other location -> samples
  for (int s = 0; s < samples.size(); ++s) {
    const auto [other, is_foreign] = suspicions[s];
    if (other < 0) continue;
    if (is_foreign) {
      foreign[{samples.location(s), samples.location(other)}].push_back(s);
    } else if (s < other && suspicions[other].other == s && !suspicions[other].is_foreign) {
      findings.push_back(SamePicture(samples, s, other));
    }
  }
  for (const auto& [locations, suspects] : foreign) {
    findings.push_back(WrongLabel(samples, suspects, suspicions[suspects[0]].other));
  }
  return findings;
}

}  // namespace

std::vector<Finding> CheckAppearance(const ImageSet& set, const Preparation& prepared, int jobs,
                                     const StageProgress& stages) {
  const Samples samples(set, prepared);
  const auto begin = [&](const char* stage) { return stages ? stages(stage) : Progress(); };
  std::vector<Finding> findings = CheckWalks(set, samples, jobs, begin("walks"));
  // Cells made from poses border on each other: images across a border do show the same.
  if (prepared.labels.location_source != "labels") return findings;
  for (Finding& finding : CheckLabelled(samples, jobs, begin("labels"))) {
    findings.push_back(std::move(finding));
  }
  return findings;
}

}  // namespace viewfix
