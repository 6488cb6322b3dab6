// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/evaluation/check_set.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "firmware_tools/evaluation/check_pixels.h"
#include "firmware_tools/evaluation/check_text.h"

namespace viewfix {
namespace {

constexpr int kThinLocation = 8;  // training images: fewer show too little of a place
constexpr int kUnbalanced = 4;    // times a view's images in the location's largest view
constexpr int kFewToLearn = 12;   // images: a poor recall is first a lack of them
constexpr double kPoorRecall = 0.5;

// Training images by location and view.
using Counts = std::map<std::string, std::map<std::string, int>>;

Counts CountTraining(const ImageSet& set) {
  Counts counts;
  for (const ImageRecord& image : set.images) {
    if (!image.is_test && !image.location.empty()) ++counts[image.location][image.view];
  }
  return counts;
}

void CheckLocations(const ImageSet& set, const Counts& counts, std::vector<Finding>& findings) {
  for (const auto& [location, views] : counts) {
    int images = 0;
    for (const auto& [view, count] : views) images += count;
    if (images >= kThinLocation) continue;
    findings.push_back(
        {images < 2 ? Severity::kError : Severity::kWarning,
         "thin_location",
         Text(location, ": only ", images, " training image", images == 1 ? "" : "s",
              ": take at least ", kThinLocation - images, " more, from about 2 m and 5 m"),
         {},
         {location}});
  }
  if (counts.size() == 1) {
    findings.push_back({Severity::kError,
                        "one_location",
                        Text(counts.begin()->first,
                             " is the only location: at least two are "
                             "needed to tell apart"),
                        {},
                        {counts.begin()->first}});
  }
  std::set<std::string> untrained;
  for (const ImageRecord& image : set.images) {
    if (!image.location.empty() && counts.count(image.location) == 0) {
      untrained.insert(image.location);
    }
  }
  for (const std::string& location : untrained) {
    findings.push_back({Severity::kWarning,
                        "untrained_location",
                        Text(location, ": has test images, but none for training"),
                        {},
                        {location}});
  }
}

void CheckUnlabelled(const ImageSet& set, std::vector<Finding>& findings) {
  Finding unlabelled{Severity::kNote, "unlabelled", ""};
  bool any_location = false;
  bool any_pose = false;
  for (const ImageRecord& image : set.images) {
    any_location |= !image.location.empty();
    any_pose |= image.pose.has_value();
    if (!image.is_test && image.location.empty()) unlabelled.images.push_back(image.path);
  }
  if (!any_location && any_pose) return;  // locations are made from the poses
  if (!any_location) {
    findings.push_back({Severity::kError, "no_locations",
                        "no image has a location, and none a pose to make one from: sort them "
                        "into folders <location>/<view>/, or add a location column"});
  } else if (!unlabelled.images.empty()) {
    unlabelled.text = Text(unlabelled.images.size(),
                           " training images have no location: no place is learnt from them (",
                           FirstFew(unlabelled.images), ")");
    findings.push_back(std::move(unlabelled));
  }
}

// How many locations have each view.
std::map<std::string, int> LocationsOfView(const Counts& counts) {
  std::map<std::string, int> locations_of;
  for (const auto& [location, views] : counts) {
    for (const auto& [view, count] : views) ++locations_of[view];
  }
  return locations_of;
}

// Views that most locations have and this one lacks.
std::string MissingViews(const std::map<std::string, int>& views,
                         const std::map<std::string, int>& locations_of, std::size_t locations) {
  std::vector<std::string> missing;
  for (const auto& [view, count] : locations_of) {
    if (views.count(view) == 0 && 2 * std::size_t(count) > locations) missing.push_back(view);
  }
  return FirstFew(missing);
}

// Where views mean directions: locations seen from one side, or unevenly.
void CheckViews(const Counts& counts, std::vector<Finding>& findings) {
  const std::map<std::string, int> locations_of = LocationsOfView(counts);
  for (const auto& [location, views] : counts) {
    const std::string missing = MissingViews(views, locations_of, counts.size());
    if (views.size() == 1) {
      findings.push_back(
          {Severity::kWarning,
           "one_view",
           Text(location, ": photographed in one direction only (", views.begin()->first,
                "): photograph it in others too", missing.empty() ? "" : ", at least " + missing),
           {},
           {location}});
    } else if (!missing.empty()) {
      findings.push_back(
          {Severity::kWarning,
           "missing_view",
           Text(location, ": no images of view ", missing, ", which most locations have"),
           {},
           {location}});
    }
    const auto most =
        std::max_element(views.begin(), views.end(),
                         [](const auto& a, const auto& b) { return a.second < b.second; });
    for (const auto& [view, count] : views) {
      if (kUnbalanced * count > most->second) continue;
      findings.push_back({Severity::kWarning,
                          "unbalanced_views",
                          Text(location, '/', view, ": only ", count, " images, where ",
                               most->first, " has ", most->second),
                          {},
                          {location}});
    }
  }
}

Finding TooManyUnusable(std::size_t failed, std::size_t asked) {
  return {Severity::kError, "too_many_unusable",
          Text(failed, " of ", asked, " training images cannot be used: more than a fifth")};
}

// What a training would refuse: too many failures, locations left with nothing.
void CheckUsable(const ImageSet& set, const FeatureStore& features,
                 std::vector<Finding>& findings) {
  std::map<std::string, std::pair<std::size_t, std::size_t>> usable_of;  // usable, all
  std::size_t asked = 0;
  for (std::size_t i = 0; i < set.images.size(); ++i) {
    if (set.images[i].is_test) continue;
    ++asked;
    auto& [usable, all] = usable_of[set.images[i].location];
    ++all;
    if (!features.images[i].keypoints.empty()) ++usable;
  }
  const std::size_t failed = features.failures.size();
  if (failed * 5 > asked) findings.push_back(TooManyUnusable(failed, asked));
  for (const auto& [location, counts] : usable_of) {
    const auto [usable, all] = counts;
    if (location.empty() || usable >= 2 || usable == all) continue;
    findings.push_back({Severity::kError,
                        "empty_location",
                        Text(location, ": ", usable, " of ", all,
                             " training images can be used: photograph it again"),
                        {},
                        {location}});
  }
}

// What a preparation needs; a finding says what is lacking.
bool CanPrepare(const ImageSet& set, const FeatureStore& features, int num_words,
                std::vector<Finding>& findings) {
  std::size_t descriptors = 0;
  bool any_place = false;
  for (std::size_t i = 0; i < set.images.size(); ++i) {
    const std::size_t count = features.images[i].keypoints.size();
    descriptors += count;
    any_place |= count > 0 && HasPlace(set, set.images[i]);
  }
  if (descriptors < static_cast<std::size_t>(num_words)) {
    findings.push_back({Severity::kError, "too_few_features",
                        Text("all training images together show only ", descriptors,
                             " features: too few for ", num_words, " visual words")});
    return false;
  }
  return any_place;
}

std::string MostCommon(const std::map<std::string, int>& counts) {
  const auto best =
      std::max_element(counts.begin(), counts.end(),
                       [](const auto& a, const auto& b) { return a.second < b.second; });
  return best == counts.end() ? "" : best->first;
}

// How the held-out samples of some pairs fared.
struct Fate {
  std::string name;
  std::string location;
  int images = 0;
  int held_out = 0;
  int right = 0;
  std::map<std::string, int> taken_for;  // wrong locations
  std::vector<std::string> missed;       // paths
};

// One for each group of pairs; group_of_pair [pairs].
std::vector<Fate> Fates(const ImageSet& set, const Labels& labels, const HeldOut& held_out,
                        const std::vector<int>& group_of_pair, int groups) {
  std::vector<Fate> fates(groups);
  for (const int pair : labels.pair) ++fates[group_of_pair[pair]].images;
  for (const HeldOut::Prediction& p : held_out.predictions) {
    const int truth = labels.pair[p.sample];
    Fate& fate = fates[group_of_pair[truth]];
    ++fate.held_out;
    if (p.location == labels.pair_location[truth]) {
      ++fate.right;
    } else {
      if (p.location >= 0) ++fate.taken_for[labels.locations[p.location]];
      fate.missed.push_back(set.images[labels.image_idxs[p.sample]].path);
    }
  }
  return fates;
}

std::vector<Fate> FatesOfPairs(const ImageSet& set, const Labels& labels, const HeldOut& held_out) {
  std::vector<int> group(labels.num_pairs());
  for (int p = 0; p < labels.num_pairs(); ++p) group[p] = p;
  std::vector<Fate> fates = Fates(set, labels, held_out, group, labels.num_pairs());
  for (int p = 0; p < labels.num_pairs(); ++p) {
    fates[p].location = labels.locations[labels.pair_location[p]];
    fates[p].name = fates[p].location + "/" + labels.views[labels.pair_view[p]];
  }
  return fates;
}

std::vector<Fate> FatesOfLocations(const ImageSet& set, const Labels& labels,
                                   const HeldOut& held_out) {
  std::vector<Fate> fates =
      Fates(set, labels, held_out, labels.pair_location, static_cast<int>(labels.locations.size()));
  for (std::size_t l = 0; l < fates.size(); ++l) {
    fates[l].name = fates[l].location = labels.locations[l];
  }
  return fates;
}

// What to photograph again, for a place whose held-out images are not found.
std::string Advice(const Fate& fate, const std::string& rival) {
  if (fate.images < kFewToLearn) {
    return Text("take more images of ", fate.name, ", from about 2 m and 5 m");
  }
  const auto taken = fate.taken_for.find(rival);
  if (taken != fate.taken_for.end() && 2 * taken->second > fate.held_out - fate.right) {
    return Text("take more images of what ", fate.name,
                " has and the other has not (signs, notices, furniture), from about 2 m and 5 m");
  }
  return Text("photograph ", fate.name, " again, a step between images, from about 2 m and 5 m");
}

std::vector<Finding> CheckRecall(const std::vector<Fate>& fates) {
  std::vector<Finding> findings;
  for (const Fate& fate : fates) {
    if (fate.held_out < 2 || fate.right >= kPoorRecall * fate.held_out) continue;
    const std::string rival = MostCommon(fate.taken_for);
    findings.push_back(
        {Severity::kWarning,
         "poor_recall",
         Text(fate.name, ": ", fate.right, " of ", fate.held_out, " held-out images found",
              rival.empty() ? "" : ", mostly taken for " + rival, ": ", Advice(fate, rival),
              " (missed: ", FirstFew(fate.missed), ")"),
         fate.missed,
         {fate.location, rival}});
  }
  return findings;
}

void Append(std::vector<Finding> more, std::vector<Finding>& findings) {
  std::move(more.begin(), more.end(), std::back_inserter(findings));
}

std::vector<ExpectedRecall> RecallRows(const Labels& labels, const std::vector<Fate>& of_pairs) {
  std::vector<ExpectedRecall> rows;
  for (int p = 0; p < labels.num_pairs(); ++p) {
    const Fate& fate = of_pairs[p];
    rows.push_back({fate.location, labels.views[labels.pair_view[p]], fate.images, fate.held_out,
                    fate.right, MostCommon(fate.taken_for)});
  }
  return rows;
}

// Held-out blocks under the default parameters: enough to see what is thin.
void CheckHeldOut(const ImageSet& set, const Preparation& prepared, TrainOptions options,
                  const StageProgress& stages, CheckReport& report) {
  const Labels& labels = prepared.labels;
  const ScoreOptions usual;
  options.c = usual.c;
  options.beta = usual.beta;
  options.other_views_negative = usual.other_views_negative;
  const HeldOut held_out = ChooseScoreOptions(prepared, options, stages).front();
  const std::vector<Fate> of_pairs = FatesOfPairs(set, labels, held_out);
  report.recall = RecallRows(labels, of_pairs);
  report.expected_location_accuracy = held_out.location_accuracy;
  report.expected_view_accuracy = held_out.view_accuracy;
  // Parts of a walk have no names that help who has to go back: the whole location is meant.
  const bool by_pair = labels.view_source != "order";
  Append(CheckRecall(by_pair ? of_pairs : FatesOfLocations(set, labels, held_out)),
         report.findings);
}

// Views by heading, where poses tell them and nobody has named any.
void CheckHeadings(const Labels& labels, std::vector<Finding>& findings) {
  if (labels.view_source != "headings" || labels.location_source != "labels") return;
  Counts counts;
  for (const int p : labels.pair) {
    ++counts[labels.locations[labels.pair_location[p]]][labels.views[labels.pair_view[p]]];
  }
  CheckViews(counts, findings);
}

void CheckFeatures(const ImageSet& set, const TrainOptions& options, const StageProgress& stages,
                   const std::vector<ImagePixels>& pixels, CheckReport& report) {
  FeatureStore features = ExtractTrainingFeatures(set, options, stages);
  Append(CheckFeatureless(set, features, pixels), report.findings);
  CheckUsable(set, features, report.findings);
  if (!CanPrepare(set, features, options.num_words, report.findings)) return;
  const Preparation prepared = PrepareFeatures(set, std::move(features), options, stages);
  CheckHeadings(prepared.labels, report.findings);
  Append(CheckAppearance(set, prepared, options.jobs, stages), report.findings);
  if (prepared.labels.locations.size() < 2) return;
  CheckHeldOut(set, prepared, options, stages, report);
}

}  // namespace

const char* SeverityName(Severity severity) {
  switch (severity) {
    case Severity::kError:
      return "error";
    case Severity::kWarning:
      return "warning";
    case Severity::kNote:
      return "note";
  }
  return "";
}

std::vector<Finding> CheckLabels(const ImageSet& set) {
  const Counts counts = CountTraining(set);
  std::vector<Finding> findings;
  CheckUnlabelled(set, findings);
  CheckLocations(set, counts, findings);
  const bool all_have_views = std::all_of(counts.begin(), counts.end(), [](const auto& location) {
    return location.second.count("") == 0;
  });
  if (all_have_views) CheckViews(counts, findings);
  return findings;
}

CheckReport CheckImageSet(const ImageSet& set, const TrainOptions& options,
                          const StageProgress& stages) {
  CheckReport report;
  report.images = static_cast<int>(set.images.size());
  report.train_images =
      static_cast<int>(std::count_if(set.images.begin(), set.images.end(),
                                     [](const ImageRecord& image) { return !image.is_test; }));
  report.findings = CheckLabels(set);
  const std::vector<ImagePixels> pixels = ReadPixels(
      set, options.features.max_image_side, options.jobs, stages ? stages("pixels") : Progress());
  Append(CheckPixels(set, pixels), report.findings);
  Append(CheckDuplicates(set, pixels), report.findings);
  if (report.train_images > 0) {
    CheckFeatures(set, options, stages, pixels, report);
  } else {
    report.findings.push_back(
        {Severity::kError, "no_training_images", "all images are marked for testing"});
  }
  std::stable_sort(report.findings.begin(), report.findings.end(),
                   [](const Finding& a, const Finding& b) { return a.severity < b.severity; });
  return report;
}

nlohmann::ordered_json ToJson(const CheckReport& report) {
  using Json = nlohmann::ordered_json;
  Json json = {{"schema", 1},
               {"images", report.images},
               {"train_images", report.train_images},
               {"findings", Json::array()}};
  for (const Finding& f : report.findings) {
    json["findings"].push_back({{"severity", SeverityName(f.severity)},
                                {"kind", f.kind},
                                {"text", f.text},
                                {"images", f.images},
                                {"locations", f.locations}});
  }
  const bool any = !report.recall.empty();
  json["expected_location_accuracy"] = any ? Json(report.expected_location_accuracy) : Json();
  json["expected_view_accuracy"] = any ? Json(report.expected_view_accuracy) : Json();
  json["recall"] = Json::array();
  for (const ExpectedRecall& r : report.recall) {
    json["recall"].push_back({{"location", r.location},
                              {"view", r.view},
                              {"images", r.images},
                              {"held_out", r.held_out},
                              {"right", r.right},
                              {"mostly_taken_for", r.mostly_taken_for}});
  }
  return json;
}

}  // namespace viewfix
