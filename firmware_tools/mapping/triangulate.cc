// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/triangulate.h"

#include <algorithm>

#include "firmware_tools/mapping/map_points.h"
#include "firmware_tools/mapping/rolling_shutter.h"
#include "firmware_tools/mapping/tracks.h"

namespace viewfix {
namespace {

constexpr double kRadians = 3.14159265358979323846 / 180;
// A track that mixes points up is worth a few points, not many.
constexpr int kMaxPointsPerTrack = 3;

class MapMaker {
 public:
  MapMaker(const MapInput& input, std::span<const VerifiedPair> pairs,
           const TriangulateOptions& options, int jobs)
      : options_(options), jobs_(jobs), image_of_(input.frames.size(), -1) {
    AddImages(input);
    AddNeighbours(pairs);
  }

  Reconstruction Make(const MapInput& input, std::span<const VerifiedPair> pairs,
                      const Progress& progress) {
    const int steps = 1 + options_.completion_rounds + 2 * options_.adjustments;
    int done = 0;
    const auto report = [&] {
      if (progress) progress(++done, steps);
    };
    Triangulate(BuildTracks(input, pairs));
    report();
    for (int round = 0; round < options_.completion_rounds; ++round) {
      Complete();
      report();
    }
    for (int round = 0; round < options_.adjustments; ++round) {
      Adjust(map_, options_.adjust);
      report();
      Complete();
      report();
    }
    UpdateErrors(map_);
    return std::move(map_);
  }

 private:
  void AddImages(const MapInput& input) {
    map_.cameras = input.cameras;
    for (std::size_t f = 0; f < input.frames.size(); ++f) {
      const MapFrame& frame = input.frames[f];
      if (!frame.cam_from_world) continue;
      image_of_[f] = static_cast<int>(map_.images.size());
      MapImage image;
      image.name = frame.name;
      image.camera_idx = frame.camera_idx;
      image.cam_from_world = *frame.cam_from_world;
      image.readout = frame.readout;
      for (const Keypoint& keypoint : frame.features->keypoints) {
        image.keypoints.push_back(Pixel(keypoint));
      }
      map_.images.push_back(std::move(image));
      features_.push_back(frame.features);
    }
    SetMotions(input, map_);
    if (map_.images.size() < 2) throw ToolError("map: fewer than two images with a pose");
  }

  void AddNeighbours(std::span<const VerifiedPair> pairs) {
    neighbours_.resize(map_.images.size());
    for (const VerifiedPair& pair : pairs) {
      const int a = image_of_[pair.frames.first_idx], b = image_of_[pair.frames.second_idx];
      if (a < 0 || b < 0) continue;
      neighbours_[a].push_back(b);
      neighbours_[b].push_back(a);
    }
  }

  void Triangulate(std::vector<std::vector<Observation>> tracks) {
    for (auto& track : tracks) {
      for (Observation& seen : track) seen.image_idx = image_of_[seen.image_idx];
      std::erase_if(track, [](const Observation& seen) { return seen.image_idx < 0; });
    }
    std::vector<std::vector<MapPoint>> points(tracks.size());
    ParallelFor(static_cast<int>(tracks.size()), jobs_,
                [&](int i) { points[i] = PointsOf(std::move(tracks[i])); });
    for (auto& of_track : points) {
      std::move(of_track.begin(), of_track.end(), std::back_inserter(map_.points));
    }
    if (map_.points.empty()) throw ToolError("map: the images' matches give no point");
    RenumberPoints(map_);
  }

  std::vector<MapPoint> PointsOf(std::vector<Observation> track) const {
    std::vector<MapPoint> points;
    while (track.size() >= 2 && points.size() < kMaxPointsPerTrack) {
      const auto solved = SolvePoint(ViewsOf(map_, track, options_.max_error_px),
                                     options_.min_angle_deg * kRadians);
      if (!solved) break;
      MapPoint& point = points.emplace_back();
      point.position = solved->position;
      for (auto i = solved->inliers.rbegin(); i != solved->inliers.rend(); ++i) {
        point.track.push_back(track[*i]);
        track.erase(track.begin() + *i);
      }
      SortTrack(point);
    }
    return points;
  }

  void Complete() {
    CompleteTracks(map_, features_, neighbours_,
                   {.max_error_px = options_.max_error_px,
                    .max_descriptor_distance = options_.max_descriptor_distance,
                    .jobs = jobs_});
    RefineAndFilter(map_, options_.max_error_px, options_.min_angle_deg, jobs_);
  }

  const TriangulateOptions& options_;
  int jobs_;
  Reconstruction map_;
  std::vector<int> image_of_;                   // [frames] -1: no pose
  std::vector<const ImageFeatures*> features_;  // [images]
  std::vector<std::vector<int>> neighbours_;    // [images]
};

}  // namespace

Reconstruction TriangulateWithPoses(const MapInput& input, std::span<const VerifiedPair> pairs,
                                    const TriangulateOptions& options, int jobs,
                                    const Progress& progress) {
  return MapMaker(input, pairs, options, jobs).Make(input, pairs, progress);
}

MapSummary Summarize(const Reconstruction& map) {
  MapSummary summary{.images = static_cast<int>(map.images.size()),
                     .points = static_cast<int>(map.points.size())};
  for (const MapPoint& point : map.points) {
    summary.observations += static_cast<int>(point.track.size());
    summary.mean_error_px += point.error_px * static_cast<double>(point.track.size());
  }
  if (summary.points > 0) {
    summary.mean_track = double(summary.observations) / summary.points;
    summary.mean_error_px /= summary.observations;
  }
  return summary;
}

}  // namespace viewfix
