// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/training/base_model.h"

#include <algorithm>
#include <numeric>

#include "firmware_tools/dataset/image_set.h"
#include "firmware_tools/training/base_map.h"

namespace viewfix {
namespace {

// Consecutive rows of a table.
struct Rows {
  int begin = 0;
  int end = 0;
  int size() const { return end - begin; }
};

Rows RowsOf(const std::vector<std::uint16_t>& ascending, int value) {
  const auto [begin, end] = std::equal_range(ascending.begin(), ascending.end(), value);
  return {static_cast<int>(begin - ascending.begin()), static_cast<int>(end - ascending.begin())};
}

template <typename T>
std::span<const T> Slice(const std::vector<T>& all, const std::vector<std::uint32_t>& begin,
                         int i) {
  return std::span(all).subspan(begin[i], begin[std::size_t(i) + 1] - begin[i]);
}

class Merger {
 public:
  Merger(const ModelData& base, bool poses_given, ModelData& model)
      : base_(base),
        poses_given_(poses_given),
        model_(model),
        base_location_(model.locations.size(), -1),
        base_keyframe_(model.keyframe_pair.size(), -1) {}

  BaseReport Merge() {
    BaseReport report = MatchLocations();
    // Scores by another rule are not on the scale of those that are kept. Details have their own.
    const bool other_rule = model_.location_rule != base_.location_rule;
    if (other_rule && model_.details.codes.empty()) model_.confidence = base_.confidence;
    model_.location_rule = base_.location_rule;
    model_.keyframe_weight = base_.keyframe_weight;
    model_.code_tables = base_.code_tables;
    KeepScores();
    KeepDetails();
    if (!base_.landmark_position.empty()) {
      report.frame_grew = KeepMaps(base_, base_keyframe_, poses_given_, model_);
    }
    return report;
  }

 private:
  BaseReport MatchLocations() {
    BaseReport report;
    for (int l = 0; l < static_cast<int>(model_.locations.size()); ++l) {
      const std::string& name = model_.locations[l];
      const auto found = std::lower_bound(base_.locations.begin(), base_.locations.end(), name);
      const bool known = found != base_.locations.end() && *found == name;
      const bool kept = known && Match(l, static_cast<int>(found - base_.locations.begin()));
      (kept ? report.kept : report.trained).push_back(name);
    }
    std::set_difference(base_.locations.begin(), base_.locations.end(), model_.locations.begin(),
                        model_.locations.end(), std::back_inserter(report.removed));
    return report;
  }

  // Whether the location is the base's `other`, and, if so, which keyframe is which.
  bool Match(int location, int other) {
    const Rows pairs = RowsOf(model_.pair_location, location);
    const Rows others = RowsOf(base_.pair_location, other);
    if (pairs.size() != others.size()) return false;
    for (int i = 0; i < pairs.size(); ++i) {
      if (!SamePair(pairs.begin + i, others.begin + i)) return false;
    }
    base_location_[location] = other;
    for (int i = 0; i < pairs.size(); ++i) {
      const Rows own = RowsOf(model_.keyframe_pair, pairs.begin + i);
      const Rows theirs = RowsOf(base_.keyframe_pair, others.begin + i);
      for (int k = 0; k < own.size(); ++k) base_keyframe_[own.begin + k] = theirs.begin + k;
    }
    return true;
  }

  bool SamePair(int pair, int other) const {
    const Rows own = RowsOf(model_.keyframe_pair, pair);
    const Rows theirs = RowsOf(base_.keyframe_pair, other);
    bool same = model_.views[model_.pair_view[pair]] == base_.views[base_.pair_view[other]] &&
                own.size() == theirs.size();
    for (int k = 0; same && k < own.size(); ++k) {
      same = SamePicture(own.begin + k, theirs.begin + k);
    }
    return same;
  }

  // Some hundred words and their counts are as good as the photograph's hash, and every model
  // has them.
  bool SamePicture(int keyframe, int other) const {
    if (base_.keyframe_names.empty() ||
        model_.keyframe_names[keyframe] != base_.keyframe_names[other]) {
      return false;
    }
    const bool same_pose = model_.keyframe_has_pose[keyframe] == base_.keyframe_has_pose[other] &&
                           model_.keyframe_pose[keyframe] == base_.keyframe_pose[other];
    return (same_pose || !poses_given_) &&
           std::ranges::equal(Slice(model_.keyframe_words, model_.keyframe_word_begin, keyframe),
                              Slice(base_.keyframe_words, base_.keyframe_word_begin, other)) &&
           std::ranges::equal(Slice(model_.keyframe_counts, model_.keyframe_word_begin, keyframe),
                              Slice(base_.keyframe_counts, base_.keyframe_word_begin, other));
  }

  void KeepScores() {
    const std::size_t pairs = model_.pair_location.size();
    const std::size_t base_pairs = base_.pair_location.size();
    for (int l = 0; l < static_cast<int>(base_location_.size()); ++l) {
      if (base_location_[l] < 0) continue;
      const Rows own = RowsOf(model_.pair_location, l);
      const int theirs = RowsOf(base_.pair_location, base_location_[l]).begin;
      for (int i = 0; i < own.size(); ++i) {
        const std::size_t p = own.begin + i;
        const std::size_t other = theirs + i;
        model_.bias[p] = base_.bias[other];
        model_.weight_scale[p] = base_.weight_scale[other];
        for (std::size_t w = 0; w * pairs < model_.weights.size(); ++w) {
          model_.weights[w * pairs + p] = base_.weights[w * base_pairs + other];
        }
      }
    }
  }

  // Adds one location's details to `merged`; of location [locations], the common ones.
  static void AddDetailsOf(const ModelData::DetailsData& from, std::size_t lists, int location,
                           ModelData::DetailsData& merged) {
    const auto sizes = from.list_size.begin();
    const auto first = sizes + static_cast<std::ptrdiff_t>(location * lists);
    const auto last = first + static_cast<std::ptrdiff_t>(lists);
    merged.list_size.insert(merged.list_size.end(), first, last);
    const std::ptrdiff_t begin = std::accumulate(sizes, first, std::ptrdiff_t{0}) * from.parts;
    const std::ptrdiff_t end = begin + std::accumulate(first, last, std::ptrdiff_t{0}) * from.parts;
    merged.codes.insert(merged.codes.end(), from.codes.begin() + begin, from.codes.begin() + end);
  }

  // The common details are the base's: what they take from a location says nothing anyhow.
  void KeepDetails() {
    const ModelData::DetailsData& theirs = base_.details;
    const ModelData::DetailsData& own = model_.details;
    if (theirs.codes.empty() || own.codes.empty()) return;
    const std::size_t lists = own.list_size.size() / (model_.locations.size() + 1);
    // The weights stay those that the confidence was fitted with.
    ModelData::DetailsData merged{own.parts, own.rotation,        own.codebook,    {},
                                  {},        own.likeness_weight, own.close_weight};
    for (int l = 0; l < static_cast<int>(base_location_.size()); ++l) {
      const bool kept = base_location_[l] >= 0;
      AddDetailsOf(kept ? theirs : own, lists, kept ? base_location_[l] : l, merged);
    }
    AddDetailsOf(theirs, lists, static_cast<int>(base_.locations.size()), merged);
    model_.details = std::move(merged);
  }

  const ModelData& base_;
  bool poses_given_;
  ModelData& model_;
  std::vector<int> base_location_;  // [locations] the base's that each one is; -1: none
  std::vector<int> base_keyframe_;  // [keyframes] likewise
};

}  // namespace

BaseModel ReadBaseModel(std::span<const std::uint8_t> file, const std::string& name) {
  const Result<ModelView> view = ModelView::Open(file);
  if (!view.ok()) throw ToolError(name + ": " + view.status().text());
  const auto hash = view->short_hash();
  return {UnpackModel(*view), std::string(hash.data(), hash.size())};
}

BaseReport KeepUnchanged(const BaseModel& base, bool poses_given, ModelData& model) {
  return Merger(base.data, poses_given, model).Merge();
}

}  // namespace viewfix
