// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/missing_tracks.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <string>
#include <tuple>
#include <utility>

namespace viewfix {
namespace {

constexpr int kColumns = 16;
constexpr int kRows = 12;
constexpr int kPatches = kColumns * kRows;
// Tracks that make a patch worth asking about, and what share of them is missing in a hole.
constexpr int kMinInPatch = 3;
constexpr double kHole = 0.6;
// Scales, pixels, at which key points are found in any image.
constexpr double kLeastSigma = 2.4;
constexpr double kGreatestSigma = 20;
// So many frames in order are judged together.
constexpr int kBlock = 4;

// Sets of numbers that only grow together.
class Groups {
 public:
  explicit Groups(std::size_t size) : parent_(size) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }

  int Of(int i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }

  void Join(int a, int b) { parent_[Of(a)] = Of(b); }

 private:
  std::vector<int> parent_;
};

// A track where frames of another stretch should see it.
struct Chance {
  int track;
  int patch;
  bool taken;
};

struct FarPair {
  int pair_idx;
  std::array<std::vector<Chance>, 2> chances;  // of the first frame's tracks, of the second's
};

struct PatchCount {
  std::int64_t patches = 0;
  std::int64_t holes = 0;
};

enum class Verdict { kSame, kUnknown, kLookAlike };

// What two walks, or two groups of walks, share.
struct Shared {
  PatchCount count;
  int pairs = 0;

  void Add(const Shared& other) {
    count.patches += other.count.patches;
    count.holes += other.count.holes;
    pairs += other.pairs;
  }
  // Few patches without a hole say less than many.
  double HoleShare() const {
    return static_cast<double>(count.holes + 1) / static_cast<double>(count.patches + 1);
  }
};

// Chances of the tracks of one side of a few pairs.
class Tally {
 public:
  explicit Tally(int num_tracks) : chances_(num_tracks, 0), taken_(num_tracks, 0) {}

  void Count(std::span<const FarPair* const> pairs, int side, int min_chances, PatchCount& count) {
    for (const FarPair* pair : pairs) {
      for (const Chance& chance : pair->chances[side]) {
        ++chances_[chance.track];
        taken_[chance.track] += chance.taken ? 1 : 0;
      }
    }
    for (const FarPair* pair : pairs) CountPatches(pair->chances[side], min_chances, count);
    for (const FarPair* pair : pairs) {
      for (const Chance& chance : pair->chances[side]) {
        chances_[chance.track] = taken_[chance.track] = 0;
      }
    }
  }

 private:
  void CountPatches(const std::vector<Chance>& chances, int min_chances, PatchCount& count) const {
    std::array<int, kPatches> tracks{}, missing{};
    for (const Chance& chance : chances) {
      if (chances_[chance.track] < min_chances) continue;
      ++tracks[chance.patch];
      missing[chance.patch] += taken_[chance.track] == 0 ? 1 : 0;
    }
    for (int p = 0; p < kPatches; ++p) {
      if (tracks[p] < kMinInPatch) continue;
      ++count.patches;
      count.holes += missing[p] >= kHole * tracks[p] ? 1 : 0;
    }
  }

  std::vector<int> chances_;  // [tracks]
  std::vector<int> taken_;
};

class MissingTracks {
 public:
  MissingTracks(const MapInput& input, std::span<const VerifiedPair> pairs,
                const MissingTrackOptions& options)
      : input_(input), pairs_(pairs), options_(options), order_(input) {
    FollowTracks();
    for (int i = 0; i < static_cast<int>(pairs_.size()); ++i) {
      const Walks walks = WalksOf(pairs_[i]);
      if (walks.first != walks.second) far_.push_back({i, ChancesOf(pairs_[i])});
    }
  }

  std::vector<VerifiedPair> Keep() {
    std::vector<Verdict> verdicts(pairs_.size(), Verdict::kSame);
    JudgeGroups(JudgeStretches(verdicts), verdicts);
    DropChanceLinks(verdicts);
    std::vector<VerifiedPair> kept;
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      if (verdicts[i] != Verdict::kLookAlike) kept.push_back(pairs_[i]);
    }
    return kept;
  }

 private:
  using Walks = std::pair<std::string, std::string>;

  bool IsFar(const FramePair& frames) const {
    return order_.AreApart(frames.first_idx, frames.second_idx, options_.window);
  }

  const std::vector<Keypoint>& KeypointsOf(int frame) const {
    return input_.frames[frame].features->keypoints;
  }

  // Key points that neighbours match belong together; those of enough frames are tracks.
  void FollowTracks() {
    std::vector<int> first = {0};
    for (const MapFrame& frame : input_.frames) {
      first.push_back(first.back() + static_cast<int>(frame.features->keypoints.size()));
    }
    Groups groups(first.back());
    for (const VerifiedPair& pair : pairs_) {
      if (IsFar(pair.frames)) continue;
      for (const FeatureMatch& match : pair.matches) {
        groups.Join(first[pair.frames.first_idx] + match.first_idx,
                    first[pair.frames.second_idx] + match.second_idx);
      }
    }
    std::vector<int> length(first.back(), 0), track_of(first.back(), -1);
    for (int i = 0; i < first.back(); ++i) ++length[groups.Of(i)];
    for (std::size_t f = 0; f < input_.frames.size(); ++f) {
      std::vector<int>& tracks = tracks_.emplace_back();
      for (int i = first[f]; i < first[f + 1]; ++i) {
        const int group = groups.Of(i);
        if (length[group] >= options_.min_length && track_of[group] < 0) {
          track_of[group] = num_tracks_++;
        }
        tracks.push_back(track_of[group]);
      }
    }
  }

  std::array<std::vector<Chance>, 2> ChancesOf(const VerifiedPair& pair) const {
    const auto [a, b] = pair.frames;
    std::array<std::vector<int>, 2> matched;
    std::vector<double> ratios;  // of scales
    for (const FeatureMatch& match : pair.matches) {
      matched[0].push_back(match.first_idx);
      matched[1].push_back(match.second_idx);
      ratios.push_back(double{KeypointsOf(b)[match.second_idx].sigma} /
                       double{KeypointsOf(a)[match.first_idx].sigma});
    }
    if (ratios.empty()) return {};
    const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
    std::nth_element(ratios.begin(), middle, ratios.end());
    return {ChancesOn(a, matched[0], *middle), ChancesOn(b, matched[1], 1 / *middle)};
  }

  // Tracks of a frame that lie among its matched key points.
  std::vector<Chance> ChancesOn(int frame, std::span<const int> matched, double scale) const {
    const std::vector<Keypoint>& keypoints = KeypointsOf(frame);
    std::vector<bool> taken(keypoints.size(), false);
    std::vector<cv::Point2f> pixels, hull;
    for (const int k : matched) {
      taken[k] = true;
      pixels.emplace_back(keypoints[k].x, keypoints[k].y);
    }
    cv::convexHull(pixels, hull);
    std::vector<Chance> chances;
    for (std::size_t k = 0; k < keypoints.size(); ++k) {
      const Keypoint& keypoint = keypoints[k];
      const double sigma = scale * double{keypoint.sigma};
      if (tracks_[frame][k] < 0) continue;
      if (!taken[k] && !(sigma >= kLeastSigma && sigma <= kGreatestSigma)) continue;
      if (!taken[k] && cv::pointPolygonTest(hull, {keypoint.x, keypoint.y}, false) < 0) continue;
      chances.push_back({tracks_[frame][k], PatchOf(frame, keypoint), taken[k]});
    }
    return chances;
  }

  int PatchOf(int frame, const Keypoint& keypoint) const {
    const Camera& camera = input_.cameras[input_.frames[frame].camera_idx];
    const auto part = [](float x, int size, int parts) {
      return std::clamp(static_cast<int>(x * float(parts) / float(size)), 0, parts - 1);
    };
    return part(keypoint.y, camera.height, kRows) * kColumns +
           part(keypoint.x, camera.width, kColumns);
  }

  // Pairs of the same two blocks of frames are judged as one, by all pairs about them. Returns what
  // the walks share.
  std::map<Walks, Shared> JudgeStretches(std::vector<Verdict>& verdicts) const {
    std::map<Walks, Shared> shared;
    std::map<Walks, std::vector<const FarPair*>> of_walks;
    for (const FarPair& far : far_) of_walks[WalksOf(pairs_[far.pair_idx])].push_back(&far);
    Tally tally(num_tracks_);
    for (const auto& [walks, all] : of_walks) {
      std::map<std::pair<int, int>, std::vector<const FarPair*>> of_blocks;
      for (const FarPair* far : all) {
        const auto [a, b] = pairs_[far->pair_idx].frames;
        of_blocks[{order_.Position(a) / kBlock, order_.Position(b) / kBlock}].push_back(far);
      }
      for (const auto& [blocks, judged] : of_blocks) {
        const PatchCount count = CountAbout(blocks.first, blocks.second, all, tally);
        const Verdict verdict = Judge(count);
        for (const FarPair* far : judged) verdicts[far->pair_idx] = verdict;
        const int pairs = static_cast<int>(judged.size());
        shared[InOrder(walks)].Add({count, pairs});
      }
    }
    return shared;
  }

  PatchCount CountAbout(int block_a, int block_b, std::span<const FarPair* const> all,
                        Tally& tally) const {
    std::vector<const FarPair*> about;
    for (const FarPair* far : all) {
      const auto [a, b] = pairs_[far->pair_idx].frames;
      const auto near = [&](int frame, int block) {
        return std::abs(order_.Position(frame) - (block * kBlock + kBlock / 2)) <= options_.window;
      };
      if (near(a, block_a) && near(b, block_b)) about.push_back(far);
    }
    PatchCount count;
    for (const int side : {0, 1}) tally.Count(about, side, options_.min_chances, count);
    return count;
  }

  Verdict Judge(const PatchCount& count) const {
    if (count.patches < options_.min_patches) return Verdict::kUnknown;
    const double most = options_.max_holes * static_cast<double>(count.patches);
    return static_cast<double>(count.holes) > most ? Verdict::kLookAlike : Verdict::kSame;
  }

  Walks WalksOf(const VerifiedPair& pair) const {
    return {input_.frames[pair.frames.first_idx].capture,
            input_.frames[pair.frames.second_idx].capture};
  }

  // Walks of one place are put together, those that share most surely first. Where what two groups
  // share has too many holes, what is left of it was only not found out: a walk that sees little
  // but what two places share goes with the place that it leaves fewer holes in.
  void JudgeGroups(const std::map<Walks, Shared>& of_walks, std::vector<Verdict>& verdicts) const {
    std::map<std::string, std::string> group_of;  // by walk; named after one of its walks
    for (const auto& [walks, shared] : of_walks) {
      group_of[walks.first] = walks.first;
      group_of[walks.second] = walks.second;
    }
    std::map<Walks, Shared> of_groups = of_walks;
    while (const auto surest = Surest(of_groups)) Join(*surest, group_of, of_groups);
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      const Walks walks = WalksOf(pairs_[i]);
      if (walks.first == walks.second) continue;
      const auto shared = of_groups.find(InOrder({group_of[walks.first], group_of[walks.second]}));
      const bool of_two_places =
          shared != of_groups.end() && Judge(shared->second.count) == Verdict::kLookAlike;
      if (of_two_places || Judge(of_walks.at(InOrder(walks)).count) == Verdict::kLookAlike) {
        verdicts[i] = Verdict::kLookAlike;
      }
    }
  }

  static Walks InOrder(Walks walks) {
    if (walks.second < walks.first) std::swap(walks.first, walks.second);
    return walks;
  }

  // Of two groups that show one place: those that leave the fewest holes.
  std::optional<Walks> Surest(const std::map<Walks, Shared>& of_groups) const {
    std::optional<Walks> surest;
    double least = 0;
    for (const auto& [groups, shared] : of_groups) {
      if (shared.pairs < options_.min_links || Judge(shared.count) != Verdict::kSame) continue;
      if (surest && shared.HoleShare() >= least) continue;
      surest = groups;
      least = shared.HoleShare();
    }
    return surest;
  }

  // What either shared with a third is shared by both.
  static void Join(const Walks& groups, std::map<std::string, std::string>& group_of,
                   std::map<Walks, Shared>& of_groups) {
    const auto& [kept, joined] = groups;
    for (auto& [walk, group] : group_of) {
      if (group == joined) group = kept;
    }
    std::map<Walks, Shared> left;
    for (const auto& [pair, shared] : of_groups) {
      if (pair == groups) continue;
      const auto renamed = [&](const std::string& name) { return name == joined ? kept : name; };
      left[InOrder({renamed(pair.first), renamed(pair.second)})].Add(shared);
    }
    of_groups = std::move(left);
  }

  void DropChanceLinks(std::vector<Verdict>& verdicts) const {
    std::map<Walks, int> same;  // pairs of two walks
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      same[WalksOf(pairs_[i])] += verdicts[i] == Verdict::kSame ? 1 : 0;
    }
    Groups groups(input_.frames.size());
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      const Walks walks = WalksOf(pairs_[i]);
      const bool many = walks.first == walks.second || same[walks] >= options_.min_links;
      const auto [a, b] = pairs_[i].frames;
      if (verdicts[i] == Verdict::kSame && many) groups.Join(a, b);
    }
    std::map<int, int> size;
    for (int f = 0; f < static_cast<int>(input_.frames.size()); ++f) ++size[groups.Of(f)];
    std::map<std::pair<int, int>, std::vector<int>> links;
    for (int i = 0; i < static_cast<int>(pairs_.size()); ++i) {
      if (verdicts[i] == Verdict::kLookAlike) continue;
      const int a = groups.Of(pairs_[i].frames.first_idx);
      const int b = groups.Of(pairs_[i].frames.second_idx);
      if (a != b) links[std::minmax(a, b)].push_back(i);
    }
    for (const auto& [joined, by] : links) {
      if (static_cast<int>(by.size()) >= options_.min_links) continue;
      if (std::min(size[joined.first], size[joined.second]) < options_.min_frames) continue;
      for (const int i : by) verdicts[i] = Verdict::kLookAlike;
    }
  }

  const MapInput& input_;
  std::span<const VerifiedPair> pairs_;
  const MissingTrackOptions& options_;
  CaptureOrder order_;
  std::vector<std::vector<int>> tracks_;  // [frames][key points] -1: none
  int num_tracks_ = 0;
  std::vector<FarPair> far_;
};

}  // namespace

std::vector<VerifiedPair> DropPairsMissingTracks(const MapInput& input,
                                                 std::span<const VerifiedPair> pairs,
                                                 const MissingTrackOptions& options) {
  return MissingTracks(input, pairs, options).Keep();
}

}  // namespace viewfix
