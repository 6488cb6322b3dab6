// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/pair_selection.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

namespace viewfix {
namespace {

FramePair Ordered(int a, int b) { return {std::min(a, b), std::max(a, b)}; }

std::map<std::string, std::vector<int>> FramesByCapture(const MapInput& input) {
  std::map<std::string, std::vector<int>> captures;
  for (std::size_t i = 0; i < input.frames.size(); ++i) {
    captures[input.frames[i].capture].push_back(static_cast<int>(i));
  }
  return captures;
}

std::set<FramePair> PairsByOrder(const MapInput& input, int window) {
  std::set<FramePair> pairs;
  for (const auto& [name, frames] : FramesByCapture(input)) {
    for (std::size_t i = 0; i < frames.size(); ++i) {
      for (std::size_t j = i + 1; j < frames.size() && j <= i + window; ++j) {
        pairs.insert(Ordered(frames[i], frames[j]));
      }
    }
  }
  return pairs;
}

bool MayOverlap(const MapFrame& a, const MapFrame& b, const PairOptions& options) {
  if (!a.cam_from_world || !b.cam_from_world) return true;
  const Rigid3 b_from_a = *b.cam_from_world * Inverse(*a.cam_from_world);
  const double cos_heading = (b_from_a.rotation * Eigen::Vector3d::UnitZ()).z();
  return cos_heading >= std::cos(options.max_heading_deg * 3.14159265358979323846 / 180) &&
         b_from_a.translation.norm() <= options.max_distance;
}

}  // namespace

std::vector<FramePair> SelectPairs(const MapInput& input, const Eigen::MatrixXf& similarity,
                                   const PairOptions& options) {
  const std::set<FramePair> by_order = PairsByOrder(input, options.window);
  std::set<FramePair> pairs = by_order;
  const int n = static_cast<int>(input.frames.size());
  for (int i = 0; i < n; ++i) {
    std::vector<int> others;
    for (int j = 0; j < n; ++j) {
      if (j != i && !by_order.contains(Ordered(i, j)) &&
          MayOverlap(input.frames[i], input.frames[j], options)) {
        others.push_back(j);
      }
    }
    const auto count = std::min<std::ptrdiff_t>(options.neighbours, std::ssize(others));
    const auto more_alike = [&](int a, int b) {
      return std::pair(-similarity(a, i), a) < std::pair(-similarity(b, i), b);
    };
    std::partial_sort(others.begin(), others.begin() + count, others.end(), more_alike);
    for (int k = 0; k < count; ++k) pairs.insert(Ordered(i, others[k]));
  }
  return {pairs.begin(), pairs.end()};
}

std::vector<FramePair> PairsBeside(const MapInput& input, std::span<const VerifiedPair> verified,
                                   std::span<const FramePair> tried, const PairOptions& options) {
  std::vector<std::vector<int>> beside(input.frames.size());  // of a frame, with itself
  for (const auto& [name, frames] : FramesByCapture(input)) {
    const int n = static_cast<int>(frames.size());
    for (int i = 0; i < n; ++i) {
      const int end = std::min(n, i + options.reach + 1);
      for (int j = std::max(0, i - options.reach); j < end; ++j) {
        beside[frames[i]].push_back(frames[j]);
      }
    }
  }
  const std::set<FramePair> by_order = PairsByOrder(input, options.window);
  const std::set<FramePair> known(tried.begin(), tried.end());
  std::map<FramePair, std::size_t> matches_beside;
  for (const VerifiedPair& pair : verified) {
    if (by_order.contains(pair.frames)) continue;
    for (const int a : beside[pair.frames.first_idx]) {
      for (const int b : beside[pair.frames.second_idx]) {
        const FramePair frames = Ordered(a, b);
        if (a == b || known.contains(frames)) continue;
        std::size_t& matches = matches_beside[frames];
        matches = std::max(matches, pair.matches.size());
      }
    }
  }
  std::vector<std::pair<FramePair, std::size_t>> ranked(matches_beside.begin(),
                                                        matches_beside.end());
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const auto& a, const auto& b) { return a.second > b.second; });
  if (ranked.size() > tried.size() / 2) ranked.resize(tried.size() / 2);
  std::vector<FramePair> pairs;
  for (const auto& [frames, matches] : ranked) pairs.push_back(frames);
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

}  // namespace viewfix
