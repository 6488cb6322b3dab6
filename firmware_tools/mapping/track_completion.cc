// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/track_completion.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "firmware_tools/mapping/map_input.h"
#include "firmware_tools/mapping/map_points.h"

namespace viewfix {
namespace {

// Key points of an image by cells of the search radius.
class KeypointGrid {
 public:
  KeypointGrid(const MapImage& image, const Camera& camera, double radius)
      : keypoints_(image.keypoints),
        radius_(radius),
        columns_(static_cast<int>(camera.width / radius) + 2),
        rows_(static_cast<int>(camera.height / radius) + 2),
        cells_(std::size_t(columns_) * rows_) {
    for (int i = 0; i < static_cast<int>(keypoints_.size()); ++i) {
      cells_[Row(keypoints_[i].y()) * columns_ + Column(keypoints_[i].x())].push_back(i);
    }
  }

  void Near(const Eigen::Vector2d& pixel, std::vector<int>& found) const {
    found.clear();
    const int column = Column(pixel.x()), row = Row(pixel.y());
    for (int r = std::max(0, row - 1); r <= std::min(rows_ - 1, row + 1); ++r) {
      for (int c = std::max(0, column - 1); c <= std::min(columns_ - 1, column + 1); ++c) {
        for (const int i : cells_[r * columns_ + c]) {
          if ((keypoints_[i] - pixel).norm() <= radius_) found.push_back(i);
        }
      }
    }
  }

 private:
  int Column(double x) const {
    return std::clamp(static_cast<int>(std::floor(x / radius_)), 0, columns_ - 1);
  }
  int Row(double y) const {
    return std::clamp(static_cast<int>(std::floor(y / radius_)), 0, rows_ - 1);
  }

  const std::vector<Eigen::Vector2d>& keypoints_;
  double radius_;
  int columns_, rows_;
  std::vector<std::vector<int>> cells_;
};

std::int32_t Distance2(std::span<const std::int8_t> a, std::span<const std::int8_t> b) {
  std::int32_t sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const std::int32_t difference = std::int32_t{a[i]} - b[i];
    sum += difference * difference;
  }
  return sum;
}

class Completion {
 public:
  Completion(Reconstruction& map, std::span<const ImageFeatures* const> features,
             std::span<const std::vector<int>> neighbours, const CompletionOptions& options)
      : map_(map),
        features_(features),
        neighbours_(neighbours),
        options_(options),
        max_distance2_(static_cast<std::int32_t>(options.max_descriptor_distance *
                                                 options.max_descriptor_distance)) {
    for (const MapImage& image : map.images) {
      const Camera& camera = map.cameras[image.camera_idx];
      grids_.emplace_back(image, camera, MaxError(image));
    }
  }

  // What is found in the map as it stands is found in parallel; it is taken in one by one,
  // in the order of points, since one key point may be found for several.
  int Run() {
    std::vector<std::vector<Observation>> found(map_.points.size());
    ParallelFor(static_cast<int>(map_.points.size()), options_.jobs,
                [&](int i) { found[i] = Find(map_.points[i]); });
    int added = 0;
    for (std::size_t i = 0; i < found.size(); ++i) {
      for (const Observation& seen : found[i]) added += Take(static_cast<int>(i), seen);
    }
    std::erase_if(map_.points, [](const MapPoint& point) { return point.track.empty(); });
    RenumberPoints(map_);
    return added;
  }

 private:
  double MaxError(const MapImage& image) const {
    return options_.max_error_px * PixelsPerNominal(map_.cameras[image.camera_idx]);
  }

  std::span<const std::int8_t> Descriptor(const Observation& seen) const {
    const ImageFeatures& features = *features_[seen.image_idx];
    const std::size_t dim = features.descriptors.size() / features.keypoints.size();
    return std::span(features.descriptors).subspan(seen.feature_idx * dim, dim);
  }

  std::vector<int> CandidateImages(const MapPoint& point) const {
    std::vector<int> images;
    for (const Observation& seen : point.track) {
      const std::vector<int>& near = neighbours_[seen.image_idx];
      images.insert(images.end(), near.begin(), near.end());
    }
    std::sort(images.begin(), images.end());
    images.erase(std::unique(images.begin(), images.end()), images.end());
    std::erase_if(images, [&](int image) { return SeenBy(point, image); });
    return images;
  }

  static bool SeenBy(const MapPoint& point, int image_idx) {
    return std::any_of(point.track.begin(), point.track.end(),
                       [&](const Observation& seen) { return seen.image_idx == image_idx; });
  }

  std::vector<Observation> Find(const MapPoint& point) const {
    std::vector<Observation> found;
    std::vector<int> near;
    for (const int image_idx : CandidateImages(point)) {
      const MapImage& image = map_.images[image_idx];
      const Camera& camera = map_.cameras[image.camera_idx];
      Eigen::Vector2d pixel;
      if (!camera.Project(image.cam_from_world * point.position, pixel)) continue;
      if (pixel.x() < 0 || pixel.y() < 0 || pixel.x() > camera.width - 1 ||
          pixel.y() > camera.height - 1) {
        continue;
      }
      grids_[image_idx].Near(pixel, near);
      const int best = MostAlike(point, image_idx, near);
      if (best >= 0) found.push_back({image_idx, best});
    }
    return found;
  }

  int MostAlike(const MapPoint& point, int image_idx, std::span<const int> near) const {
    int best = -1;
    std::int32_t best_distance2 = max_distance2_ + 1;
    for (const int feature_idx : near) {
      const Observation candidate{image_idx, feature_idx};
      for (const Observation& seen : point.track) {
        if (Keypoint(seen).laplacian_sign != Keypoint(candidate).laplacian_sign) break;
        const std::int32_t distance2 = Distance2(Descriptor(seen), Descriptor(candidate));
        if (distance2 >= best_distance2) continue;
        best_distance2 = distance2;
        best = feature_idx;
      }
    }
    return best;
  }

  const viewfix::Keypoint& Keypoint(const Observation& seen) const {
    return features_[seen.image_idx]->keypoints[seen.feature_idx];
  }

  int Take(int point_idx, const Observation& seen) {
    MapPoint& point = map_.points[point_idx];
    if (point.track.empty() || SeenBy(point, seen.image_idx)) return 0;
    int& owner = map_.images[seen.image_idx].point_idx[seen.feature_idx];
    if (owner >= 0) return Join(point_idx, owner);
    owner = point_idx;
    point.track.push_back(seen);
    SortTrack(point);
    return 1;
  }

  // The longer track takes the shorter one in, where one point explains both.
  int Join(int a, int b) {
    if (a == b) return 0;
    if (map_.points[a].track.size() < map_.points[b].track.size()) std::swap(a, b);
    MapPoint& kept = map_.points[a];
    MapPoint& other = map_.points[b];
    for (const Observation& seen : other.track) {
      if (SeenBy(kept, seen.image_idx)) return 0;
    }
    std::vector<Observation> track = kept.track;
    track.insert(track.end(), other.track.begin(), other.track.end());
    const std::vector<PointView> views = ViewsOf(map_, track, options_.max_error_px);
    const Eigen::Vector3d position = RefinePoint(views, kept.position);
    for (const PointView& view : views) {
      if (PointError(view, position) > view.max_error_px) return 0;
    }
    const int joined = static_cast<int>(other.track.size());
    for (const Observation& seen : other.track) {
      map_.images[seen.image_idx].point_idx[seen.feature_idx] = a;
    }
    other.track.clear();
    kept.track = std::move(track);
    kept.position = position;
    SortTrack(kept);
    return joined;
  }

  Reconstruction& map_;
  std::span<const ImageFeatures* const> features_;
  std::span<const std::vector<int>> neighbours_;
  const CompletionOptions& options_;
  std::int32_t max_distance2_;
  std::vector<KeypointGrid> grids_;  // [images]
};

}  // namespace

int CompleteTracks(Reconstruction& map, std::span<const ImageFeatures* const> features,
                   std::span<const std::vector<int>> neighbours, const CompletionOptions& options) {
  return Completion(map, features, neighbours, options).Run();
}

}  // namespace viewfix
