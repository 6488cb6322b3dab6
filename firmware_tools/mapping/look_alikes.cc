// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/look_alikes.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <opencv2/calib3d.hpp>
#include <string>

namespace viewfix {
namespace {

constexpr int kColumns = 8;
constexpr int kRows = 6;
constexpr int kCells = kColumns * kRows;
// Confirmed key points that make a cell worth asking about.
constexpr int kMinInCell = 3;
// Surroundings lie at other depths than what matches: the homography is a rough guide.
constexpr double kHomographyError = 8;

struct CellCount {
  int expected = 0;
  int matched = 0;
};

class LookAlikes {
 public:
  LookAlikes(const MapInput& input, std::span<const VerifiedPair> pairs,
             const LookAlikeOptions& options)
      : input_(input), pairs_(pairs), options_(options), order_(input) {
    CountConfirmed();
  }

  std::vector<VerifiedPair> Keep() const {
    std::vector<int> far;
    std::vector<CellCount> counts(pairs_.size());
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      if (AreNeighbours(pairs_[i].frames.first_idx, pairs_[i].frames.second_idx)) continue;
      far.push_back(static_cast<int>(i));
      counts[i] = CountCells(pairs_[i]);
    }
    std::vector<bool> is_dropped(pairs_.size(), false);
    for (const int i : far) is_dropped[i] = IsLookAlike(i, far, counts);
    std::vector<VerifiedPair> kept;
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      if (!is_dropped[i]) kept.push_back(pairs_[i]);
    }
    return kept;
  }

 private:
  bool AreNeighbours(int a, int b) const { return !order_.AreApart(a, b, options_.window); }

  // Key points that neighbouring frames see too: they belong to the place, not to noise.
  void CountConfirmed() {
    std::vector<std::vector<int>> seen;
    for (const MapFrame& frame : input_.frames) {
      seen.emplace_back(frame.features->keypoints.size(), 0);
    }
    for (const VerifiedPair& pair : pairs_) {
      const auto [a, b] = pair.frames;
      if (!AreNeighbours(a, b)) continue;
      for (const FeatureMatch& match : pair.matches) {
        ++seen[a][match.first_idx];
        ++seen[b][match.second_idx];
      }
    }
    for (std::size_t f = 0; f < seen.size(); ++f) {
      std::vector<int>& cells = confirmed_.emplace_back(kCells, 0);
      for (std::size_t k = 0; k < seen[f].size(); ++k) {
        const int cell = Cell(static_cast<int>(f), Pixel(input_.frames[f].features->keypoints[k]));
        if (seen[f][k] >= 2 && cell >= 0) ++cells[cell];
      }
    }
  }

  // -1: outside the image.
  int Cell(int frame, const Eigen::Vector2d& pixel) const {
    const Camera& camera = input_.cameras[input_.frames[frame].camera_idx];
    const double x = (pixel.x() + 0.5) / camera.width, y = (pixel.y() + 0.5) / camera.height;
    if (!(x >= 0 && x < 1 && y >= 0 && y < 1)) return -1;
    return static_cast<int>(y * kRows) * kColumns + static_cast<int>(x * kColumns);
  }

  Eigen::Vector2d CellCentre(int frame, int cell) const {
    const Camera& camera = input_.cameras[input_.frames[frame].camera_idx];
    return {(cell % kColumns + 0.5) * camera.width / kColumns - 0.5,
            (cell / kColumns + 0.5) * camera.height / kRows - 0.5};
  }

  cv::Mat Homography(const VerifiedPair& pair) const {
    std::vector<cv::Point2f> first, second;
    for (const FeatureMatch& match : pair.matches) {
      const Keypoint& a = input_.frames[pair.frames.first_idx].features->keypoints[match.first_idx];
      const Keypoint& b =
          input_.frames[pair.frames.second_idx].features->keypoints[match.second_idx];
      first.emplace_back(a.x, a.y);
      second.emplace_back(b.x, b.y);
    }
    if (first.size() < 4) return {};
    return cv::findHomography(first, second, cv::RANSAC, kHomographyError);
  }

  CellCount CountCells(const VerifiedPair& pair) const {
    const auto [a, b] = pair.frames;
    CellCount count;
    const cv::Mat homography = Homography(pair);
    if (homography.empty()) return count;
    const cv::Matx33d second_from_first = homography;
    std::vector<int> matches(kCells, 0);
    for (const FeatureMatch& match : pair.matches) {
      const int cell = Cell(a, Pixel(input_.frames[a].features->keypoints[match.first_idx]));
      if (cell >= 0) ++matches[cell];
    }
    for (int cell = 0; cell < kCells; ++cell) {
      if (confirmed_[a][cell] < kMinInCell) continue;
      const Eigen::Vector2d centre = CellCentre(a, cell);
      const cv::Vec3d mapped = second_from_first * cv::Vec3d(centre.x(), centre.y(), 1);
      if (mapped[2] <= 0) continue;
      const int other = Cell(b, {mapped[0] / mapped[2], mapped[1] / mapped[2]});
      if (other < 0 || confirmed_[b][other] < kMinInCell) continue;
      ++count.expected;
      count.matched += matches[cell] > 0;
    }
    return count;
  }

  bool IsLookAlike(int pair, std::span<const int> far, std::span<const CellCount> counts) const {
    const auto [a, b] = pairs_[pair].frames;
    CellCount sum;
    for (const int other : far) {
      const auto [c, d] = pairs_[other].frames;
      const bool same_stretches = (AreNeighbours(a, c) && AreNeighbours(b, d)) ||
                                  (AreNeighbours(a, d) && AreNeighbours(b, c));
      if (!same_stretches) continue;
      sum.expected += counts[other].expected;
      sum.matched += counts[other].matched;
    }
    return sum.expected >= options_.min_cells && sum.matched < options_.min_share * sum.expected;
  }

  const MapInput& input_;
  std::span<const VerifiedPair> pairs_;
  const LookAlikeOptions& options_;
  CaptureOrder order_;
  std::vector<std::vector<int>> confirmed_;  // [frames][cells] confirmed key points
};

}  // namespace

std::vector<VerifiedPair> DropLookAlikes(const MapInput& input, std::span<const VerifiedPair> pairs,
                                         const LookAlikeOptions& options) {
  return LookAlikes(input, pairs, options).Keep();
}

}  // namespace viewfix
