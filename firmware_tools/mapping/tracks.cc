// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/tracks.h"

#include <algorithm>
#include <numeric>
#include <tuple>

namespace viewfix {
namespace {

// Key points of all frames in one row of numbers, and the sets that links make of them.
class LinkedSets {
 public:
  explicit LinkedSets(const MapInput& input) {
    for (const MapFrame& frame : input.frames) {
      begin_.push_back(static_cast<int>(frame_of_.size()));
      frame_of_.insert(frame_of_.end(), frame.features->keypoints.size(),
                       static_cast<int>(begin_.size()) - 1);
    }
    parent_.resize(frame_of_.size());
    std::iota(parent_.begin(), parent_.end(), 0);
    members_.resize(frame_of_.size());
  }

  int Node(int frame_idx, int feature_idx) const { return begin_[frame_idx] + feature_idx; }

  void Link(int a, int b) {
    int root = Find(a), other = Find(b);
    if (root == other) return;
    if (members_[root].size() < members_[other].size()) std::swap(root, other);
    std::vector<int> merged = Members(root);
    const std::vector<int> more = Members(other);
    merged.insert(merged.end(), more.begin(), more.end());
    std::sort(merged.begin(), merged.end());
    const auto same_frame = [&](int x, int y) { return frame_of_[x] == frame_of_[y]; };
    if (std::adjacent_find(merged.begin(), merged.end(), same_frame) != merged.end()) return;
    members_[root] = std::move(merged);
    members_[other].clear();
    parent_[other] = root;
  }

  std::vector<std::vector<Observation>> Sets() const {
    std::vector<std::vector<Observation>> sets;
    for (const std::vector<int>& members : members_) {
      if (members.empty()) continue;
      std::vector<Observation>& set = sets.emplace_back();
      for (const int node : members) {
        set.push_back({frame_of_[node], node - begin_[frame_of_[node]]});
      }
    }
    return sets;
  }

 private:
  int Find(int node) {
    while (parent_[node] != node) node = parent_[node] = parent_[parent_[node]];
    return node;
  }
  // Nodes are numbered by frame, so that ascending members stand by frame.
  std::vector<int> Members(int root) const {
    return members_[root].empty() ? std::vector<int>{root} : members_[root];
  }

  std::vector<int> begin_;                 // [frames] first node
  std::vector<int> frame_of_;              // [nodes]
  std::vector<int> parent_;                // [nodes]
  std::vector<std::vector<int>> members_;  // [nodes] of roots with more than themselves
};

}  // namespace

std::vector<std::vector<Observation>> BuildTracks(const MapInput& input,
                                                  std::span<const VerifiedPair> pairs) {
  LinkedSets sets(input);
  std::vector<std::tuple<std::int32_t, int, int>> links;  // distance2, nodes
  for (const VerifiedPair& pair : pairs) {
    for (const FeatureMatch& match : pair.matches) {
      links.emplace_back(match.distance2, sets.Node(pair.frames.first_idx, match.first_idx),
                         sets.Node(pair.frames.second_idx, match.second_idx));
    }
  }
  std::sort(links.begin(), links.end());
  for (const auto& [distance2, a, b] : links) sets.Link(a, b);
  return sets.Sets();
}

}  // namespace viewfix
