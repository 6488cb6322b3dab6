// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/pair_consistency.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <set>

namespace viewfix {
namespace {

constexpr double kDegrees = 180 / 3.14159265358979323846;
// A place: frames this far apart in order, or of other captures, are different ones.
constexpr int kPlace = 30;

struct Votes {
  int support = 0;
  int contradiction = 0;
};

class Consistency {
 public:
  Consistency(const MapInput& input, std::span<const VerifiedPair> pairs,
              const ConsistencyOptions& options)
      : input_(input), pairs_(pairs), options_(options), order_(input), kept_(pairs.size(), true) {
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      pair_of_[pairs[i].frames] = static_cast<int>(i);
    }
    FindLoops();
  }

  std::vector<VerifiedPair> Keep() {
    DropContradicted();
    DropUnsupported();
    DropCommonplace();
    std::vector<VerifiedPair> kept;
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      if (kept_[i]) kept.push_back(pairs_[i]);
    }
    return kept;
  }

 private:
  struct Loop {
    int pairs[3];
    double error_deg;
    int closed;  // key points that return to themselves
  };

  // The key point of the second frame that one of the first is matched with; -1: none.
  static int Follow(const VerifiedPair& pair, int first_idx) {
    const auto match =
        std::lower_bound(pair.matches.begin(), pair.matches.end(), first_idx,
                         [](const FeatureMatch& m, int idx) { return m.first_idx < idx; });
    const bool found = match != pair.matches.end() && match->first_idx == first_idx;
    return found ? match->second_idx : -1;
  }

  static int CountClosed(const VerifiedPair& ab, const VerifiedPair& bc, const VerifiedPair& ac) {
    return static_cast<int>(
        std::count_if(ac.matches.begin(), ac.matches.end(), [&](const FeatureMatch& match) {
          const int in_b = Follow(ab, match.first_idx);
          return in_b >= 0 && Follow(bc, in_b) == match.second_idx;
        }));
  }

  bool IsFarApart(const VerifiedPair& pair) const {
    return order_.AreApart(pair.frames.first_idx, pair.frames.second_idx, options_.window);
  }

  // Frames a < b < c whose three pairs were all verified.
  void FindLoops() {
    std::vector<std::vector<int>> later(input_.frames.size());
    for (const auto& [frames, pair] : pair_of_)
      later[frames.first_idx].push_back(frames.second_idx);
    for (const auto& [frames, pair] : pair_of_) {
      const auto [a, b] = frames;
      for (const int c : later[b]) {
        const auto closing = pair_of_.find({a, c});
        if (closing == pair_of_.end()) continue;
        const int bc = pair_of_.at({b, c});
        const Eigen::Quaterniond around =
            pairs_[bc].second_from_first.rotation * pairs_[pair].second_from_first.rotation;
        const double error =
            around.angularDistance(pairs_[closing->second].second_from_first.rotation) * kDegrees;
        const int closed = CountClosed(pairs_[pair], pairs_[bc], pairs_[closing->second]);
        loops_.push_back({{pair, bc, closing->second}, error, closed});
      }
    }
  }

  // Loops whose other two pairs are still believed.
  std::vector<Votes> CountVotes() const {
    std::vector<Votes> votes(pairs_.size());
    for (const Loop& loop : loops_) {
      if (!kept_[loop.pairs[0]] || !kept_[loop.pairs[1]] || !kept_[loop.pairs[2]]) continue;
      const bool closes = loop.closed >= options_.min_closed;
      for (const int pair : loop.pairs) {
        votes[pair].support += closes || loop.error_deg <= options_.max_loop_error_deg;
        votes[pair].contradiction += !closes && loop.error_deg >= options_.min_contradiction_deg;
      }
    }
    return votes;
  }

  // One wrong pair spoils the loops of right ones: those that are contradicted most go first.
  void DropContradicted() {
    for (double least_share = 0.9; least_share > 0.45; least_share -= 0.1) {
      const std::vector<Votes> votes = CountVotes();
      for (std::size_t i = 0; i < pairs_.size(); ++i) {
        const int total = votes[i].support + votes[i].contradiction;
        if (total > 0 && votes[i].contradiction > least_share * total) kept_[i] = false;
      }
    }
  }

  void DropUnsupported() {
    const std::vector<Votes> votes = CountVotes();
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      const int needed = IsFarApart(pairs_[i]) ? options_.min_support : 1;
      const bool many = static_cast<int>(pairs_[i].matches.size()) >= options_.min_lone_inliers;
      const bool lone_neighbours = !IsFarApart(pairs_[i]) && many;
      if (votes[i].support < needed && !lone_neighbours) kept_[i] = false;
    }
  }

  // The other places that a key point matches: frames apart from each other and from both
  // frames of the pair.
  int OtherPlaces(const std::vector<int>& matched, const FramePair& pair) const {
    std::vector<int> places;
    for (const int frame : matched) {
      const auto near = [&](int place) { return !order_.AreApart(frame, place, kPlace); };
      if (near(pair.first_idx) || near(pair.second_idx)) continue;
      if (std::none_of(places.begin(), places.end(), near)) places.push_back(frame);
    }
    return static_cast<int>(places.size());
  }

  void DropCommonplace() {
    std::map<std::pair<int, int>, std::vector<int>> matched;  // key point -> frames
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      if (!kept_[i]) continue;
      const auto [a, b] = pairs_[i].frames;
      for (const FeatureMatch& match : pairs_[i].matches) {
        matched[{a, match.first_idx}].push_back(b);
        matched[{b, match.second_idx}].push_back(a);
      }
    }
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      if (!kept_[i] || !IsFarApart(pairs_[i])) continue;
      const FramePair& frames = pairs_[i].frames;
      double distinctive = 0;
      for (const FeatureMatch& match : pairs_[i].matches) {
        const int others =
            std::max(OtherPlaces(matched[{frames.first_idx, match.first_idx}], frames),
                     OtherPlaces(matched[{frames.second_idx, match.second_idx}], frames));
        distinctive += 1.0 / (1 + others);
      }
      if (distinctive < options_.min_distinctive) kept_[i] = false;
    }
  }

  const MapInput& input_;
  std::span<const VerifiedPair> pairs_;
  const ConsistencyOptions& options_;
  CaptureOrder order_;
  std::map<FramePair, int> pair_of_;
  std::vector<Loop> loops_;
  std::vector<bool> kept_;  // [pairs]
};

}  // namespace

std::vector<VerifiedPair> KeepConsistentPairs(const MapInput& input,
                                              std::span<const VerifiedPair> pairs,
                                              const ConsistencyOptions& options) {
  return Consistency(input, pairs, options).Keep();
}

}  // namespace viewfix
