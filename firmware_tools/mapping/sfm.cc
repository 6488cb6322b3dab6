// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/sfm.h"

#include <algorithm>
#include <set>
#include <unordered_map>

#include "firmware_tools/mapping/kept_map.h"

namespace viewfix {
namespace {

constexpr double kDegrees = 180 / 3.14159265358979323846;

using Stages = std::function<Progress(const std::string& stage)>;

Progress Open(const Stages& stages, const std::string& stage) {
  return stages ? stages(stage) : Progress();
}

// The input without poses, of some of its frames; the others keep their place but have no
// features, so that indices stay.
MapInput Restrict(const MapInput& input, const std::vector<bool>& taken) {
  static const ImageFeatures kNone;
  MapInput restricted = input;
  for (std::size_t f = 0; f < taken.size(); ++f) {
    restricted.frames[f].cam_from_world.reset();
    if (!taken[f]) restricted.frames[f].features = &kNone;
  }
  return restricted;
}

template <typename Pair, typename GetFrames>
std::vector<Pair> Among(std::span<const Pair> pairs, const std::vector<bool>& taken,
                        GetFrames frames_of) {
  std::vector<Pair> among;
  for (const Pair& pair : pairs) {
    const FramePair frames = frames_of(pair);
    if (taken[frames.first_idx] && taken[frames.second_idx]) among.push_back(pair);
  }
  return among;
}

// Poses of a map given to the frames of its names, and taken from all others.
void TakePoses(const Reconstruction& map, MapInput& input) {
  std::unordered_map<std::string, const MapImage*> images;
  for (const MapImage& image : map.images) images[image.name] = &image;
  for (MapFrame& frame : input.frames) {
    const auto image = images.find(frame.name);
    frame.cam_from_world.reset();
    if (image != images.end()) frame.cam_from_world = image->second->cam_from_world;
  }
}

// The maps of one set of frames, one after another.
class Mapper {
 public:
  Mapper(std::span<const FramePair> candidates, std::span<const VerifiedPair> pairs,
         const SfmOptions& options, int jobs, const Stages& stages)
      : candidates_(candidates), pairs_(pairs), options_(options), jobs_(jobs), stages_(stages) {}

  // A map without images where COLMAP makes none.
  Reconstruction Map(const MapInput& input, const ColmapOptions& colmap) {
    const auto trial = RunColmapMapper(input, pairs_, colmap, jobs_, Open(stages_, "colmap"));
    if (!trial) return {};
    MapInput posed = input;
    Take(trial->map, posed);
    // COLMAP's poses may be off by more than matches tolerate: its own matches come first.
    std::vector<VerifiedPair> matches(pairs_.begin(), pairs_.end());
    for (int round = 0; round < options_.refinements; ++round) {
      if (round > 0) {
        RegisterFrames(Triangulate(posed, matches, options_.triangulate), pairs_,
                       options_.registration, posed);
        matches = Match(posed);
      }
      const Reconstruction adjusted = Triangulate(posed, matches, Adjusting());
      Take(adjusted, posed);
      DropOutliers(adjusted, posed);
    }
    return Triangulate(posed, Match(posed), options_.triangulate);
  }

 private:
  // Poses and cameras of a map, and its key points.
  void Take(const Reconstruction& map, MapInput& posed) {
    posed.cameras = CamerasOf(map, posed);
    TakePoses(map, posed);
    std::size_t image = 0;
    unrolled_.resize(posed.frames.size());
    for (std::size_t f = 0; f < posed.frames.size(); ++f) {
      if (posed.frames[f].cam_from_world) TakeKeypoints(map.images[image++], f, posed.frames[f]);
    }
  }

  void TakeKeypoints(const MapImage& image, std::size_t frame_idx, MapFrame& frame) {
    if (image.readout == frame.readout) return;
    ImageFeatures& unrolled = unrolled_[frame_idx];
    if (frame.features != &unrolled) unrolled = *frame.features;
    for (std::size_t k = 0; k < image.keypoints.size(); ++k) {
      unrolled.keypoints[k].x = static_cast<float>(image.keypoints[k].x());
      unrolled.keypoints[k].y = static_cast<float>(image.keypoints[k].y());
    }
    frame.features = &unrolled;
    frame.readout = image.readout;
  }

  // COLMAP keeps the cameras' order, unless one has no image.
  static std::vector<Camera> CamerasOf(const Reconstruction& map, const MapInput& input) {
    std::vector<Camera> cameras = input.cameras;
    for (const MapImage& image : map.images) {
      for (const MapFrame& frame : input.frames) {
        if (frame.name == image.name) cameras[frame.camera_idx] = map.cameras[image.camera_idx];
      }
    }
    return cameras;
  }

  // Matches of frames with a pose are chosen anew under the poses; the other pairs stay.
  std::vector<VerifiedPair> Match(const MapInput& posed) const {
    std::vector<FramePair> known;
    for (const FramePair& frames : candidates_) {
      if (posed.frames[frames.first_idx].cam_from_world &&
          posed.frames[frames.second_idx].cam_from_world) {
        known.push_back(frames);
      }
    }
    return VerifyPairs(posed, known, options_.two_view, jobs_, Open(stages_, "matching again"));
  }

  TriangulateOptions Adjusting() const {
    TriangulateOptions options = options_.adjusting;
    options.adjust.focal |= options_.colmap.refine_focal;
    return options;
  }

  Reconstruction Triangulate(const MapInput& posed, const std::vector<VerifiedPair>& pairs,
                             const TriangulateOptions& options) const {
    return TriangulateWithPoses(posed, pairs, options, jobs_,
                                Open(stages_, options.adjustments > 0 ? "adjusting" : "points"));
  }

  void DropOutliers(const Reconstruction& map, MapInput& posed) const {
    std::vector<std::vector<double>> errors(posed.frames.size());
    for (const VerifiedPair& pair : pairs_) {
      if (static_cast<int>(pair.matches.size()) < options_.min_sure_matches) continue;
      const auto& first = posed.frames[pair.frames.first_idx].cam_from_world;
      const auto& second = posed.frames[pair.frames.second_idx].cam_from_world;
      if (!first || !second) continue;
      const double error = kDegrees * pair.second_from_first.rotation.angularDistance(
                                          second->rotation * first->rotation.conjugate());
      errors[pair.frames.first_idx].push_back(error);
      errors[pair.frames.second_idx].push_back(error);
    }
    std::size_t image = 0;
    for (std::size_t f = 0; f < posed.frames.size(); ++f) {
      if (!posed.frames[f].cam_from_world) continue;
      const auto& point_idx = map.images[image++].point_idx;
      const auto seen =
          std::count_if(point_idx.begin(), point_idx.end(), [](int point) { return point >= 0; });
      if (seen >= options_.min_image_points && Median(errors[f]) <= options_.max_image_error_deg) {
        continue;
      }
      posed.frames[f].cam_from_world.reset();
    }
  }

  static double Median(std::vector<double>& values) {
    if (values.empty()) return 0;
    const auto middle = values.begin() + values.size() / 2;
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
  }

  std::span<const FramePair> candidates_;
  std::span<const VerifiedPair> pairs_;
  const SfmOptions& options_;
  int jobs_;
  const Stages& stages_;
  std::vector<ImageFeatures> unrolled_;  // [frames] rid of the rolling shutter
};

// Frames of the largest set that pairs connect, of those taken.
std::vector<bool> LargestComponent(std::span<const VerifiedPair> pairs,
                                   const std::vector<bool>& taken) {
  std::vector<std::vector<int>> near(taken.size());
  for (const VerifiedPair& pair : pairs) {
    near[pair.frames.first_idx].push_back(pair.frames.second_idx);
    near[pair.frames.second_idx].push_back(pair.frames.first_idx);
  }
  std::vector<bool> done(taken.size(), false);
  std::vector<int> largest;
  for (int start = 0; start < static_cast<int>(taken.size()); ++start) {
    std::vector<int> found = {start};
    if (done[start] || !taken[start]) continue;
    done[start] = true;
    for (std::size_t i = 0; i < found.size(); ++i) {
      for (const int next : near[found[i]]) {
        if (done[next] || !taken[next]) continue;
        done[next] = true;
        found.push_back(next);
      }
    }
    if (found.size() > largest.size()) largest = std::move(found);
  }
  std::vector<bool> component(taken.size(), false);
  for (const int f : largest) component[f] = true;
  return component;
}

}  // namespace

std::vector<VerifiedPair> BelievedPairs(const MapInput& input, std::span<const VerifiedPair> pairs,
                                        const SfmOptions& options) {
  const auto consistent = KeepConsistentPairs(input, pairs, options.consistency);
  const auto distinct = DropLookAlikes(input, consistent, options.look_alikes);
  return DropPairsMissingTracks(input, distinct, options.missing_tracks);
}

SfmResult MapPhotographs(const MapInput& input, std::span<const FramePair> candidates,
                         std::span<const VerifiedPair> pairs, const SfmOptions& options, int jobs,
                         const std::function<Progress(const std::string& stage)>& stages) {
  const std::vector<VerifiedPair> believed = BelievedPairs(input, pairs, options);
  SfmResult result;
  std::set<std::string> mapped;
  std::vector<bool> left(input.frames.size(), true);
  for (int m = 0; m < options.max_maps; ++m) {
    const std::vector<bool> taken = LargestComponent(believed, left);
    if (std::count(taken.begin(), taken.end(), true) < options.min_frames) break;
    const auto its_candidates =
        Among<FramePair>(candidates, taken, [](const FramePair& pair) { return pair; });
    const auto its_pairs =
        Among<VerifiedPair>(believed, taken, [](const VerifiedPair& pair) { return pair.frames; });
    ColmapOptions colmap = options.colmap;
    colmap.work_folder /= "map" + std::to_string(m + 1);
    const MapInput its_input = Restrict(input, taken);
    const auto compute = [&] {
      return Mapper(its_candidates, its_pairs, options, jobs, stages).Map(its_input, colmap);
    };
    Reconstruction map =
        options.cache == nullptr
            ? compute()
            : options.cache->Recall("maps", MapKey(its_input, its_candidates, its_pairs, colmap),
                                    MapCodec(), compute);
    const bool is_worth_it = static_cast<int>(map.images.size()) >= options.min_frames;
    std::set<std::string> names;
    for (const MapImage& image : map.images) names.insert(image.name);
    for (std::size_t f = 0; f < left.size(); ++f) {
      const bool is_done = is_worth_it ? names.contains(input.frames[f].name) : taken[f];
      if (is_done) left[f] = false;
    }
    if (!is_worth_it) continue;
    mapped.merge(names);
    result.maps.push_back(std::move(map));
  }
  if (result.maps.empty()) throw ToolError("the photographs give no map: too few of them overlap");
  for (const MapFrame& frame : input.frames) {
    if (!mapped.contains(frame.name)) result.unmapped.push_back(frame.name);
  }
  return result;
}

}  // namespace viewfix
