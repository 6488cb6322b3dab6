// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/map_points.h"

#include <algorithm>
#include <numeric>

#include "firmware_tools/mapping/map_input.h"

namespace viewfix {
namespace {

constexpr double kRadians = 3.14159265358979323846 / 180;

// Empties the track of a point that is not worth keeping.
void RefineOne(const Reconstruction& map, double max_error_px, double min_angle, MapPoint& point) {
  std::vector<PointView> views = ViewsOf(map, point.track, max_error_px);
  point.position = RefinePoint(views, point.position);
  std::vector<Observation> kept;
  std::vector<PointView> kept_views;
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (PointError(views[i], point.position) > views[i].max_error_px) continue;
    kept.push_back(point.track[i]);
    kept_views.push_back(views[i]);
  }
  const bool good = kept.size() >= 2 && WidestAngle(kept_views, point.position) >= min_angle;
  point.track = good ? std::move(kept) : std::vector<Observation>();
}

int CountObservations(const Reconstruction& map) {
  const auto add = [](int sum, const MapPoint& point) {
    return sum + static_cast<int>(point.track.size());
  };
  return std::accumulate(map.points.begin(), map.points.end(), 0, add);
}

}  // namespace

std::vector<PointView> ViewsOf(const Reconstruction& map, std::span<const Observation> track,
                               double max_error_px) {
  std::vector<PointView> views;
  views.reserve(track.size());
  for (const Observation& seen : track) {
    const MapImage& image = map.images[seen.image_idx];
    const Camera& camera = map.cameras[image.camera_idx];
    views.push_back(MakePointView(camera, image.cam_from_world, image.keypoints[seen.feature_idx],
                                  max_error_px * PixelsPerNominal(camera)));
  }
  return views;
}

Reconstruction Without(const Reconstruction& map, const std::set<std::string>& names) {
  Reconstruction left;
  left.cameras = map.cameras;
  std::vector<int> new_idx(map.images.size(), -1);
  for (std::size_t i = 0; i < map.images.size(); ++i) {
    if (names.contains(map.images[i].name)) continue;
    new_idx[i] = static_cast<int>(left.images.size());
    left.images.push_back(map.images[i]);
  }
  for (const MapPoint& point : map.points) {
    MapPoint kept = point;
    std::erase_if(kept.track, [&](const Observation& o) { return new_idx[o.image_idx] < 0; });
    if (kept.track.size() < 2) continue;
    for (Observation& o : kept.track) o.image_idx = new_idx[o.image_idx];
    left.points.push_back(std::move(kept));
  }
  RenumberPoints(left);
  return left;
}

void SortTrack(MapPoint& point) {
  std::sort(point.track.begin(), point.track.end(),
            [](const Observation& a, const Observation& b) { return a.image_idx < b.image_idx; });
}

void RenumberPoints(Reconstruction& map) {
  for (MapImage& image : map.images) image.point_idx.assign(image.keypoints.size(), -1);
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    for (const Observation& seen : map.points[i].track) {
      map.images[seen.image_idx].point_idx[seen.feature_idx] = static_cast<int>(i);
    }
  }
}

int RefineAndFilter(Reconstruction& map, double max_error_px, double min_angle_deg, int jobs) {
  const int before = CountObservations(map);
  ParallelFor(static_cast<int>(map.points.size()), jobs, [&](int i) {
    RefineOne(map, max_error_px, min_angle_deg * kRadians, map.points[i]);
  });
  std::erase_if(map.points, [](const MapPoint& point) { return point.track.empty(); });
  RenumberPoints(map);
  return before - CountObservations(map);
}

}  // namespace viewfix
