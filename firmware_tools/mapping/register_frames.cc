// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/mapping/register_frames.h"

#include <opencv2/calib3d.hpp>
#include <optional>
#include <set>

namespace viewfix {
namespace {

// USAC has constants in pixels inside: it is given those of a camera of this focal length.
constexpr double kFocal = 500;

struct Correspondences {
  std::vector<cv::Point3d> points_in_world;
  std::vector<cv::Point2d> pixels;  // of a pinhole camera of kFocal, about its centre
};

std::vector<int> ImageOfFrame(const MapInput& input) {
  std::vector<int> image_of;
  int next = 0;
  for (const MapFrame& frame : input.frames) image_of.push_back(frame.cam_from_world ? next++ : -1);
  return image_of;
}

class Registrar {
 public:
  Registrar(const Reconstruction& map, std::span<const VerifiedPair> pairs, const MapInput& input,
            const RegisterOptions& options)
      : map_(map),
        input_(input),
        options_(options),
        image_of_(ImageOfFrame(input)),
        links_(input.frames.size()) {
    for (const VerifiedPair& pair : pairs) {
      const auto [first, second] = pair.frames;
      for (const FeatureMatch& match : pair.matches) {
        AddLink(first, match.first_idx, second, match.second_idx);
        AddLink(second, match.second_idx, first, match.first_idx);
      }
    }
  }

  std::optional<Rigid3> Register(int frame_idx) const {
    const Correspondences found = Collect(frame_idx);
    const int n = static_cast<int>(found.pixels.size());
    if (n < options_.min_inliers) return std::nullopt;
    const Camera& camera = input_.cameras[input_.frames[frame_idx].camera_idx];
    cv::UsacParams params;
    params.confidence = 0.9999;
    params.maxIterations = 5000;
    params.randomGeneratorState = options_.seed;
    params.score = cv::SCORE_METHOD_MSAC;
    params.loMethod = cv::LOCAL_OPTIM_INNER_LO;
    params.threshold = options_.max_error_px * PixelsPerNominal(camera) * kFocal / camera.fx;
    cv::Matx33d k(kFocal, 0, 0, 0, kFocal, 0, 0, 0, 1);
    cv::Vec3d rotation, translation;
    std::vector<int> inliers;
    if (!cv::solvePnPRansac(found.points_in_world, found.pixels, k, cv::noArray(), rotation,
                            translation, inliers, params)) {
      return std::nullopt;
    }
    const int count = static_cast<int>(inliers.size());
    if (count < options_.min_inliers || count < options_.min_inlier_share * n) return std::nullopt;
    const Eigen::Vector3d turn(rotation[0], rotation[1], rotation[2]);
    const double angle = turn.norm();
    const Eigen::Vector3d axis =
        angle > 0 ? Eigen::Vector3d(turn / angle) : Eigen::Vector3d(1, 0, 0);
    return Rigid3{Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis)),
                  {translation[0], translation[1], translation[2]}};
  }

 private:
  void AddLink(int frame, int feature, int mapped_frame, int mapped_feature) {
    if (image_of_[frame] >= 0 || image_of_[mapped_frame] < 0) return;
    const int point = map_.images[image_of_[mapped_frame]].point_idx[mapped_feature];
    if (point >= 0) links_[frame].insert({feature, point});
  }

  Correspondences Collect(int frame_idx) const {
    const MapFrame& frame = input_.frames[frame_idx];
    const Camera& camera = input_.cameras[frame.camera_idx];
    Correspondences found;
    for (const auto& [feature_idx, point_idx] : links_[frame_idx]) {
      Eigen::Vector3d bearing;
      if (!camera.Unproject(Pixel(frame.features->keypoints[feature_idx]), bearing)) continue;
      if (bearing.z() <= 0) continue;
      const Eigen::Vector3d& position = map_.points[point_idx].position;
      found.points_in_world.emplace_back(position.x(), position.y(), position.z());
      found.pixels.emplace_back(kFocal * bearing.x() / bearing.z(),
                                kFocal * bearing.y() / bearing.z());
    }
    return found;
  }

  const Reconstruction& map_;
  const MapInput& input_;
  const RegisterOptions& options_;
  std::vector<int> image_of_;                         // [frames] -1: no pose
  std::vector<std::set<std::pair<int, int>>> links_;  // [frames] key point, point of the map
};

}  // namespace

int RegisterFrames(const Reconstruction& map, std::span<const VerifiedPair> pairs,
                   const RegisterOptions& options, MapInput& input) {
  std::vector<std::optional<Rigid3>> poses(input.frames.size());
  const Registrar registrar(map, pairs, input, options);
  for (std::size_t f = 0; f < poses.size(); ++f) {
    if (!input.frames[f].cam_from_world) poses[f] = registrar.Register(static_cast<int>(f));
  }
  int count = 0;
  for (std::size_t f = 0; f < poses.size(); ++f) {
    if (!poses[f]) continue;
    input.frames[f].cam_from_world = poses[f];
    ++count;
  }
  return count;
}

}  // namespace viewfix
